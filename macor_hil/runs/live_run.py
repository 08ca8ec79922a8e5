"""A live run, from beginning to end: drive a robot by a map, and leave it standing.

::

    serve            read the map, make the planner: nothing has moved yet
                     take over signals, open Zenoh, tell watchers
                     wait for robot and camera, open them
      drive          until a collision, the last command, a goal, or somebody ends the run
        _drive_on      look, plan, drive a command, learn, tell watchers; again
        _steered       pause or change planner, where that is allowed (`telemetry.wishes.steer_key`)
        _back_off      after a collision, where that does not end the run: away from the wall
        _recover       after a failure: stop, wait until robot and camera work, drive on
                     whatever is raised stops the robot before it goes on (`standing_on_failure`)
                     close robot and camera, tell how the run ended, close Zenoh

A Khepera has no watchdog: it does what it was last told for as long as its battery lasts. Every
way out of the loop therefore sends a stop and waits for its confirmation. Motor commands are
targets of the position controller, so even a controller that is killed leaves a robot that comes to
rest at the end of its last command.

What may end a drive is asked between any two requests to the robot: signals and the stop key
(`safety.interruption`), a camera that fails while the robot drives (`CameraWatch`), and the thread
that tells watchers (`RunReporter.check`). A planner that takes long is told by `LateBell`. There,
too, a supervisor gets its signs of life: from the loop that drives, and from no thread beside it.
"""

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from math import inf
from typing import Any, Final

import numpy as np
import zenoh
from khepera_protocol.system.supervisor import Supervisor
from khepera_protocol.zenoh.controller_payloads import Phase, Steer
from khepera_protocol.zenoh.payloads import Pose

from macor_hil.errors import CameraError, MacorError, RobotError
from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, is_hopeless, limits_of
from macor_hil.hardware.devices import Hardware, hardware_at
from macor_hil.hardware.driver import LONGEST_WAY, Driver, DriveSettings, all_of
from macor_hil.hardware.standstill import standing_on_failure
from macor_hil.hardware.way_out import STUCK, drive_away
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import memory_for
from macor_hil.mind.experience import Moment
from macor_hil.mind.map_file import load_map
from macor_hil.mind.planners.planner import Aim, Plan, Planner, Preparing, aim_of, is_over
from macor_hil.runs.agent import Agent
from macor_hil.runs.learning.learning_on import LearningOn, learning_on
from macor_hil.runs.options import AfterCollision, RunOptions
from macor_hil.runs.recovery import longer_and_longer, pause, wait_for, wait_until_both_work
from macor_hil.runs.run_reporter import Ending, OnStep, RunReport, RunReporter
from macor_hil.runs.trials import drive
from macor_hil.safety.interruption import Interruption, signals_taken_over
from macor_hil.safety.late_bell import LateBell
from macor_hil.telemetry.metrics import metrics_of
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.steer_key import Helm, PausedError, steer_key
from macor_hil.telemetry.wishes.stop_key import stop_key

_log = logging.getLogger(__name__)

_IN_A_ROW: Final = 5
"""Failures without a command between them after which a run gives up, or takes its time."""

_SOON: Final = 8
"""Commands from one collision to the next after which a robot turns, too, before it goes on."""

_STUCK_PAUSE: Final = 10.0
"""Seconds that a robot stands which touches something wherever it turns."""

_ORIGIN: Final = Pose(x=0.0, y=0.0, heading=0.0)


def serve(options: RunOptions, on_step: OnStep | None = None, start: Pose = _ORIGIN) -> RunReport:
    """Drive until a collision, the last command, a goal or a signal; the robot stands afterwards.

    SIGINT, SIGTERM and SIGHUP are taken over meanwhile and end the run. When robot or camera
    fail, the robot is stopped and the run goes on as soon as both work again.

    Args:
        options: what to drive.
        on_step: hears every decision when its outcome is known.
        start: where odometry begins.

    Raises:
        MacorError: map, profile, planner, Zenoh session, robot or camera cannot be used, or
            failed for good. If the robot could not be stopped, the message says so.
    """
    supervisor = Supervisor.of(os.environ)
    with ExitStack() as stack:
        interruption = stack.enter_context(signals_taken_over())
        brain, settings, learning = _prepare(options, stack)
        planner = _prepared(_planner_of(options, brain), brain)
        helm = Helm(partial(_check_course, options, brain))
        session, publisher = stack.enter_context(_telemetry(options, interruption, helm))
        reporter = stack.enter_context(
            RunReporter(
                options, interruption, settings.wheels, start, publisher, on_step, supervisor
            )
        )
        if options.metrics_port is not None:
            stack.enter_context(metrics_of(reporter.figures, options.robot, options.metrics_port))
        supervisor.ready(f"waits for {options.port}")
        stack.callback(supervisor.stopping)
        check = all_of(interruption.check, supervisor.alive)
        try:
            with _hardware(options, session, reporter, check) as hardware:
                run = _LiveRun(
                    options,
                    settings,
                    hardware,
                    brain,
                    reporter,
                    interruption,
                    check,
                    learning,
                    helm,
                )
                reporter.ending = run.drive(planner)
        except KeyboardInterrupt:
            reporter.ending = Ending.INTERRUPTED
        return reporter.report()


def _planner_of(options: RunOptions, brain: Brain) -> Planner:
    """Return a planner, for whose memory the map is refused before anything moves."""
    planner = options.make_planner()
    memory_for(brain, planner)
    return planner


def _prepared(planner: Planner, brain: Brain) -> Planner:
    if isinstance(planner, Preparing):
        planner.prepare(memory_for(brain, planner))
    return planner


def _check_course(options: RunOptions, brain: Brain, wish: Steer) -> None:
    """Refuse a planner or goal that cannot be had."""
    _planner_of(options.steered(wish), brain)


def _prepare(
    options: RunOptions, stack: ExitStack
) -> tuple[Brain, DriveSettings, LearningOn | None]:
    """Read what is driven by, with what was measured on the robot; where it learns, keep it."""
    brain, training = load_map(options.map_file, options.allow)
    if not brain.clusterer.size:
        raise MacorError(f"the map {options.map_file} holds no situations; train it first")
    learning = None
    if options.learn:
        memory = options.make_planner().memory
        place = options.map_file, brain, training, memory, options.save_every
        learning = stack.enter_context(learning_on(*place))
    measured = options.measured()
    if measured.mirror is not None:
        brain.eyes.look_through(measured.mirror)
    return brain, options.drive_settings(measured.wheels), learning


@contextmanager
def _hardware(
    options: RunOptions,
    session: zenoh.Session | None,
    reporter: RunReporter,
    check: Callable[[], None],
) -> Iterator[Hardware]:
    """Open robot and camera when they are there; on the way out the robot is stopped."""
    with ExitStack() as stack:

        def open_both() -> Hardware:
            return stack.enter_context(hardware_at(options, session))

        yield wait_for(open_both, options.wait, check, reporter.missing)


@contextmanager
def _telemetry(
    options: RunOptions, interruption: Interruption, helm: Helm
) -> Iterator[tuple[zenoh.Session | None, Publisher | None]]:
    with ExitStack() as stack:
        if not (options.listen or options.connect or options.zenoh_config):
            yield None, None
            return
        session = stack.enter_context(
            open_session(options.listen, options.connect, options.zenoh_config)
        )
        publisher = stack.enter_context(Publisher(session, options.robot))
        if options.stop_key:
            stack.enter_context(stop_key(session, options.robot, interruption.ask))
        if options.steer_key:
            stack.enter_context(steer_key(session, options.robot, helm))
        yield session, publisher


class _LiveRun:
    """The part of a run in which the robot may drive.

    Args:
        options, settings: what is driven, and how.
        hardware: open.
        brain: what is driven by.
        reporter: counts and tells.
        interruption: what may end it.
        check: raises where the run is to end, and gives signs of life.
        learning: keeps what is learned; None: nothing is.
        helm: the wishes of those who may steer it.
    """

    def __init__(
        self,
        options: RunOptions,
        settings: DriveSettings,
        hardware: Hardware,
        brain: Brain,
        reporter: RunReporter,
        interruption: Interruption,
        check: Callable[[], None],
        learning: LearningOn | None,
        helm: Helm,
    ) -> None:
        self._options = options
        self._settings = settings
        self._robot = hardware.robot
        self._camera = CheckedCamera(hardware.camera, limits_of(brain.eyes))
        self._brain = brain
        self._reporter = reporter
        self._interruption = interruption
        self._check = check
        self._learning = learning
        self._helm = helm
        self._in_a_row = 0
        self._stuck = self._since_begin = 0

    def drive(self, planner: Planner) -> Ending:
        """Drive to a collision that is to end the run, the last command, or a goal.

        Raises:
            RobotError, CameraError: the hardware fails, and does not come back in time.
        """
        reporter = self._reporter
        reporter.follow(self._robot)
        reporter.learned(self._brain)
        rng = np.random.default_rng(self._options.seed)
        if self._options.wait:
            self._await_picture()
        with (
            CameraWatch(self._camera, self._options.camera_limit) as watch,
            LateBell(self._options.planner_limit, self._planner_is_late) as bell,
            # the inner one: the robot is stopped first
            standing_on_failure(self._robot, LONGEST_WAY),
        ):
            guard = all_of(self._check, watch.guard, reporter.check, self._helm.guard)
            driver = Driver(self._robot, self._settings, guard)
            agent = Agent(self._brain, driver, reporter.watched(self._camera))
            timed = _TimedPlanner(planner, bell, self._reporter)
            after = self._options.after_collision
            while True:
                timed = self._steered(timed, bell)
                try:
                    ending = self._drive_on(agent, timed, rng)
                    if ending is None:
                        continue
                    if ending is not Ending.COLLISION or after is AfterCollision.STOP:
                        return ending
                    self._back_off(driver, rng)
                except PausedError:
                    self._find()
                except (RobotError, CameraError) as error:
                    self._recover(error)

    def _await_picture(self) -> None:
        """Wait for the first picture while the robot stands."""
        wait_for(self._camera.grab, self._options.wait, self._check, self._reporter.missing)

    def _drive_on(self, agent: Agent, planner: Planner, rng: np.random.Generator) -> Ending | None:
        """Drive to the end of the run, or a collision; None where somebody steers it."""
        reporter, limit = self._reporter, self._options.commands
        reporter.begin()
        self._since_begin = 0
        left = limit - reporter.driven if limit else None
        aim = None
        for step in drive(agent, planner, rng, left, learn=self._learning is not None):
            self._in_a_row = 0
            self._since_begin += 1
            aim = aim_of(planner, step.after.moment)
            reporter.count(step, self._robot, aim)
            if self._learning is not None:
                self._learning.count()
                reporter.lived = self._learning.lived
            self._check()
            if step.outcome.collided:
                return Ending.COLLISION
            if self._helm.wants:
                return None
        # a robot that stands at its goal from the beginning drives no command
        at_goal = is_over(aim) or not limit or reporter.driven < limit
        return Ending.GOAL if at_goal else Ending.COMMANDS

    def _back_off(self, driver: Driver, rng: np.random.Generator) -> None:
        """Drive away from what the robot has collided with.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        _log.info("a collision after %d commands: it backs off", self._since_begin)
        self._reporter.say(Phase.BACKING_OFF)
        drive_away(driver, rng, turn=self._since_begin < _SOON)
        self._reporter.move_to(self._robot.counters())
        self._stuck = self._stuck + 1 if self._since_begin == 1 else 0
        if self._stuck >= STUCK:
            why = "the robot touches something wherever it turns; put it on free floor"
            _log.warning(why)
            self._reporter.say(Phase.RECOVERING, why)
            pause(_STUCK_PAUSE, self._check)

    def _steered(self, planner: "_TimedPlanner", bell: LateBell) -> "_TimedPlanner":
        """Stand as long as somebody wants it, and return the planner to go on with."""
        if self._helm.paused:
            self._reporter.say(Phase.PAUSED)
            self._helm.hold(all_of(self._check, self._reporter.check))
        course = self._helm.course()
        if course is None:
            return planner
        self._options = self._options.steered(course)
        self._reporter.change_course(self._options)
        chosen = _prepared(_planner_of(self._options, self._brain), self._brain)
        return _TimedPlanner(chosen, bell, self._reporter)

    def _recover(self, error: MacorError) -> None:
        """Stop, wait until robot and camera work again, and know where that leaves the robot.

        Raises:
            RobotError, CameraError: they do not in time; or nothing but failures comes.
        """
        patience = self._options.recovery
        while True:
            more = self._get_back(error, patience)
            if more > 0:
                pause(longer_and_longer(more), self._check)
            try:
                self._reporter.move_to(self._robot.counters())
                break
            except RobotError as again:
                error = again
        self._reporter.recoveries += 1

    def _find(self) -> None:
        """Know where a robot stands that was stopped in mid-command.

        Raises:
            RobotError, CameraError: see `_recover`.
        """
        try:
            self._reporter.move_to(self._robot.counters())
        except RobotError as error:
            self._recover(error)

    def _get_back(self, error: MacorError, patience: float) -> int:
        """Wait until robot and camera work; return how many failures too many were in a row."""
        if patience <= 0.0 or self._interruption.name or is_hopeless(error, self._camera):
            raise error
        self._in_a_row += 1
        more = self._in_a_row - _IN_A_ROW
        if more > 0 and patience < inf:
            raise error
        _log.warning("recovering from: %s", error)
        self._reporter.say(Phase.RECOVERING, str(error))
        wait_until_both_work(self._robot, self._camera, patience, self._check)
        return more

    def _planner_is_late(self) -> None:
        """Tell that the planner has not decided for a while; the robot stands meanwhile."""
        limit = self._options.planner_limit
        reason = f"the planner has not decided for {limit:g} s; the robot stands"
        _log.warning(reason)
        self._reporter.say(Phase.LATE, reason)


class _TimedPlanner:
    """A planner that is timed while it plans.

    Args:
        planner: who plans.
        bell: rings when it takes long.
        reporter: tells when it has decided after that.
    """

    def __init__(self, planner: Planner, bell: LateBell, reporter: RunReporter) -> None:
        self._planner = planner
        self._bell = bell
        self._reporter = reporter

    @property
    def memory(self) -> str:
        """Name of the memory that the planner reads."""
        return self._planner.memory

    def plan(self, memory: Any, now: Moment) -> Plan:
        """Let the planner plan."""
        begin = time.perf_counter()
        with self._bell.timing(lambda: self._reporter.say(Phase.DRIVING)):
            plan = self._planner.plan(memory, now)
        self._reporter.plans.add(time.perf_counter() - begin)
        return plan

    def aim(self, now: Moment) -> Aim | None:
        """Return the planner's goal, if it has one."""
        return aim_of(self._planner, now)
