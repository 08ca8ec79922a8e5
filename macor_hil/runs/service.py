"""The live loop: drive a robot by a map, tell the world, and leave the robot standing.

A Khepera has no watchdog: it does what it was last told for as long as its battery lasts. Every
way out of the loop therefore sends a stop and waits for its confirmation. Motor commands are
targets of the position controller, so even a controller that is killed leaves a robot that comes to
rest at the end of its last command.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace

import zenoh

from macor_hil.errors import MacorError
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.profile import load_profile
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import make_planner, memory_for
from macor_hil.mind.map_file import load_map
from macor_hil.runs.live_run import LiveRun, OnStep
from macor_hil.runs.service_config import Ending, RunReport, ServiceConfig
from macor_hil.safety.interruption import Interruption, signals_taken_over
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.stop_key import StopKey

__all__ = ["Ending", "OnStep", "RunReport", "ServiceConfig", "serve"]


def serve(config: ServiceConfig, on_step: OnStep | None = None) -> RunReport:
    """Drive until a collision, the last command, or a signal; the robot stands afterwards.

    SIGINT, SIGTERM and SIGHUP are taken over meanwhile and end the run. When robot or camera
    fail, the robot is stopped and the run goes on as soon as both work again.

    Args:
        config: what to drive.
        on_step: hears every decision when its outcome is known.

    Raises:
        MacorError: map, profile, planner, Zenoh session, robot or camera cannot be used, or
            failed for good. If the robot could not be stopped, the message says so.
    """
    brain, drive = _prepare(config)
    planner = make_planner(config.planner)
    memory_for(brain, planner)  # a map without it is refused before anything moves
    with (
        signals_taken_over() as interruption,
        _telemetry(config, interruption) as (session, publisher),
        LiveRun(config, drive, publisher, on_step, interruption) as run,
    ):
        try:
            with open_hardware(
                config.port,
                config.camera,
                baud=config.baud,
                session=session,
                name=config.robot,
            ) as hardware:
                run.ending = run.drive(hardware, brain, planner)
        except KeyboardInterrupt:
            run.ending = Ending.INTERRUPTED
        return RunReport(run.ending, run.driven, run.total, interruption.name, run.recoveries)


def _prepare(config: ServiceConfig) -> tuple[Brain, DriveSettings]:
    """What is driven by, with what was measured on the robot."""
    brain, _ = load_map(config.map_file)
    if not brain.clusterer.size:
        raise MacorError(f"the map {config.map_file} holds no situations; train it first")
    if config.profile is None:
        return brain, config.drive
    profile = load_profile(config.profile)
    if profile.mirror is not None:
        brain.eyes.look_through(profile.mirror)
    return brain, replace(config.drive, wheels=profile.wheels)


@contextmanager
def _telemetry(
    config: ServiceConfig, interruption: Interruption
) -> Iterator[tuple[zenoh.Session | None, Publisher | None]]:
    with ExitStack() as stack:
        if not (config.listen or config.connect or config.zenoh_config):
            yield None, None
            return
        session = stack.enter_context(
            open_session(config.listen, config.connect, config.zenoh_config)
        )
        publisher = stack.enter_context(Publisher(session, config.robot))
        if config.stop_key:
            stack.enter_context(StopKey(session, config.robot, interruption.ask))
        yield session, publisher
