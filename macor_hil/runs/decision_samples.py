"""From what the controller works with to the payloads that tell of it."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Final

from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import (
    Ahead,
    Alternative,
    Command,
    Decision,
    Eye,
    Fields,
    Goal,
    Hypothesis,
    Learned,
    Link,
    Odometry,
    Situation,
)

from macor_hil.commands import COMMANDS
from macor_hil.hardware.line.line_statistics import Reading
from macor_hil.mind.brain import Brain
from macor_hil.mind.eyes.opponent import CHANNELS
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.planners.planner import Aim
from macor_hil.runs.agent import Step

_DIGITS: Final = 4
"""Of activities and features, which are many and only looked at."""


def decision_of(
    step: Step,
    *,
    time: float,
    sequence: int,
    total_reinforcement: float,
    odometry: Odometry,
    aim: Aim | None = None,
) -> Decision:
    """Return the payload of a step.

    Args:
        step: what was seen, planned, driven and earned.
        time: seconds on the robot's clock, after the command.
        sequence: number of the step in its run, from 0.
        total_reinforcement: of the run, this step included.
        odometry: after the command.
        aim: the planner's goal as it is seen after it; None: it has none.
    """
    seen = step.before.moment
    return Decision(
        time=time,
        sequence=sequence,
        frame_time=step.before.frame.time,
        situation=Situation(
            node=int(seen.resonance.node),
            neuron=int(seen.neuron),
            resonant=bool(seen.resonance.resonant),
            match=float(seen.resonance.match),
        ),
        alternatives=[
            Alternative(command=command.name, evaluation=value)
            for command, value in zip(COMMANDS, step.plan.evaluations, strict=True)
        ],
        command=COMMANDS[step.command].name,
        steps=step.plan.steps,
        sequence_ahead=_ahead(step.plan.sequence),
        hypotheses=[
            Hypothesis(evaluation=weighed.evaluation, ahead=_ahead(weighed.neurons))
            for weighed in step.plan.hypotheses
        ],
        activities=[round(activity, _DIGITS) for activity in step.plan.activities],
        features=seen.features.round(_DIGITS).tolist(),
        reinforcement=step.reinforcement,
        total_reinforcement=total_reinforcement,
        collided=step.outcome.collided,
        infrared=list(step.outcome.proximity),
        odometry=odometry,
        goal=None if aim is None else Goal(name=aim.name, bearing=aim.bearing, reached=aim.reached),
    )


def learned_of(brain: Brain) -> Learned:
    """Describe a map; eyes other than receptive fields have no sectors."""
    fields, mirror = Fields(sectors=0, width=0.0, channels=[]), Mirror()
    if isinstance(brain.eyes, PanoramaEyes):
        seen = brain.eyes.fields
        fields = Fields(sectors=seen.sectors, width=seen.width, channels=list(CHANNELS))
        mirror = brain.eyes.mirror
    return Learned(
        situations=brain.clusterer.size,
        transitions=brain.transitions,
        commands=[Command(**asdict(command)) for command in COMMANDS],
        fields=fields,
        eye=Eye(**asdict(mirror)),
    )


def link_of(reading: Reading, time: float) -> Link:
    """Return the payload of a meter's reading at a time in seconds on the robot's clock."""
    return Link(time=time, **asdict(reading))


def _ahead(neurons: Iterable[int]) -> list[Ahead]:
    places = (divmod(neuron, len(COMMANDS)) for neuron in neurons)
    return [Ahead(node=node, command=COMMANDS[command].name) for node, command in places]
