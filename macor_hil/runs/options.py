"""Options of trainings, trials and live runs, each declared once."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, Self

from khepera_protocol.options import Cli
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT
from khepera_protocol.zenoh.controller_payloads import Steer
from pydantic import Field, field_validator

from macor_hil.errors import MacorError
from macor_hil.hardware.cameras.camera_watch import DEFAULT_LIMIT
from macor_hil.hardware.options import (
    DeviceOptions,
    DriveOptions,
    Options,
    ProfileOptions,
    SeedOptions,
    SpeedOptions,
)
from macor_hil.mind.options import AllowOptions, PlannerOptions
from macor_hil.mind.planners.destinations import NAMES as DESTINATIONS
from macor_hil.mind.planners.destinations import destination
from macor_hil.mind.planners.planner import Planner
from macor_hil.runs.training import Recovery, Schedule
from macor_hil.runs.trials import MAX_COMMANDS

_SCHEDULE: Final = Schedule()

_TO_GOALS: Final = "goal"
"""The planner that drives to goals."""

_MOST_COMMANDS: Final = 500_000
"""Of each kind: a map of more transitions than both together would not be read again."""


class MapOptions(Options):
    """A map."""

    map_file: Annotated[Path, Cli(flags=("--map",))] = Field(
        default=Path("runs/corridor.npz"), description="Map file."
    )


class RecoveryChoice(StrEnum):
    """Ways of going on after a collision in training."""

    AUTO = "auto"
    RESET = "reset"
    BACK = "back"


class AfterCollision(StrEnum):
    """Ways of going on after a collision in a live run."""

    STOP = "stop"
    BACK_OFF = "back-off"


class TrainOptions(SeedOptions, ProfileOptions, SpeedOptions, DeviceOptions, MapOptions):
    """A training on a robot."""

    tuning: int = Field(
        default=_SCHEDULE.tuning,
        ge=10,
        le=4_000,
        description="Commands driven first, to tune the receptive fields.",
    )
    random: int = Field(
        default=_SCHEDULE.random,
        ge=0,
        le=_MOST_COMMANDS,
        description="Randomly selected commands.",
    )
    reactive: int = Field(
        default=_SCHEDULE.reactive,
        ge=0,
        le=_MOST_COMMANDS,
        description="Reactively selected commands after them; the paper's section 3.1 has"
        " --random 11000 --reactive 2000.",
    )
    recovery: RecoveryChoice = Field(
        default=RecoveryChoice.AUTO,
        description="After a collision: drive back, or the emulator's reset.",
    )
    listen: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(),
        description="Where watchers find this training, and an emulated robot inside this process.",
    )
    restart: Annotated[bool, Cli(flags=("--restart",))] = Field(
        default=False, description="Begin anew, even with a map or checkpoint there."
    )

    @property
    def schedule(self) -> Schedule:
        """Amount of training."""
        auto = Recovery.RESET if self.address.embedded else Recovery.BACK
        return Schedule(
            tuning=self.tuning,
            random=self.random,
            reactive=self.reactive,
            seed=self.seed,
            recovery=auto if self.recovery is RecoveryChoice.AUTO else Recovery(self.recovery),
        )


class TrialOptions(SeedOptions, AllowOptions, SpeedOptions, DeviceOptions, MapOptions):
    """Trials on an emulated robot."""

    trials: int = Field(default=10, ge=1, description="Trials of each planner.")


class RunOptions(
    SeedOptions, AllowOptions, PlannerOptions, DriveOptions, DeviceOptions, MapOptions
):
    """A live run: what to drive, with what, and who may watch.

    With neither `listen` nor `connect` nor `zenoh_config` there is no Zenoh session at all.
    """

    goal: Annotated[str, Cli(metavar="NAME", names=lambda: DESTINATIONS)] = Field(
        default="",
        description="Drive to what the camera sees, with the planner goal: {names}. The run ends"
        " there, or with the last command.",
    )
    commands: int = Field(
        default=MAX_COMMANDS, ge=0, description="Commands to drive at most; 0: without end."
    )
    after_collision: AfterCollision = Field(
        default=AfterCollision.STOP,
        description="After a collision: end, or drive back, turn where there is no way back, and go"
        " on.",
    )
    learn: Annotated[bool, Cli(flags=("--learn",))] = Field(
        default=False, description="Learn on while driving, and keep what is learned in the map."
    )
    save_every: int = Field(
        default=50,
        ge=1,
        description="Commands after which --learn writes the map; all ends but a kill write it,"
        " too.",
    )
    listen: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT,), description="Where watchers find this controller."
    )
    stop_key: Annotated[bool, Cli(flags=("--stop-key",))] = Field(
        default=False, description="Let whoever reaches macor/NAME/stop end the run."
    )
    steer_key: Annotated[bool, Cli(flags=("--steer-key",))] = Field(
        default=False,
        description="Let whoever reaches macor/NAME/steer pause the run and choose planner and"
        " goal.",
    )
    camera_limit: float = Field(
        default=DEFAULT_LIMIT,
        ge=0.0,
        description="Seconds of driving without a usable picture before the robot is stopped; 0:"
        " look only when it stands.",
    )
    planner_limit: float = Field(
        default=0.5,
        ge=0.01,
        description="Seconds of planning after which watchers are told.",
    )
    wait: float = Field(
        default=0.0,
        ge=0.0,
        allow_inf_nan=True,
        description="Seconds to wait for port and camera to be there at the start; inf: as long as"
        " it takes.",
    )
    recovery: float = Field(
        default=30.0,
        ge=0.0,
        allow_inf_nan=True,
        description="Seconds to go on trying when robot or camera fail; 0: a failure ends the run;"
        " inf: never give up.",
    )
    metrics_port: int | None = Field(
        default=None,
        ge=1,
        le=65535,
        description="TCP port for Prometheus, on this machine only: http://127.0.0.1:PORT/metrics.",
    )

    @field_validator("goal")
    @classmethod
    def _is_a_destination(cls, goal: str) -> str:
        try:
            return goal and destination(goal).name
        except MacorError as error:
            raise ValueError(str(error)) from None

    @property
    def planner_name(self) -> str:
        """Name of the planner: where a goal is given, the one that drives to goals."""
        default = RunOptions.model_fields["planner"].default
        return _TO_GOALS if self.goal and self.planner == default else self.planner

    def steered(self, wish: Steer) -> Self:
        """Return these options with another planner or goal.

        Raises:
            MacorError: there is no such goal.
        """
        planner = wish.planner or (_TO_GOALS if wish.goal else self.planner_name)
        goal = wish.goal if wish.goal is not None or planner != _TO_GOALS else self.goal
        name = destination(goal).name if goal else ""
        return self.model_copy(update={"planner": planner, "goal": name})

    def make_planner(self) -> Planner:
        """Make the planner with its settings, the goal among them.

        Raises:
            MacorError: there is no such planner, a setting is wrong, or it takes no goal.
        """
        if not self.goal:
            return super().make_planner()
        goal = f"planner.goal={self.goal}"
        aimed = self.model_copy(update={"settings": (*self.settings, goal)})
        return aimed.make_planners([self.planner_name])[0]
