"""From a step of the agent to the payload that tells of it."""

from macor_hil.agent import Step
from macor_hil.drive import COMMANDS
from macor_hil.telemetry.schemas import Ahead, Alternative, Decision, Odometry, Situation


def decision_of(
    step: Step, *, time: float, sequence: int, total_reinforcement: float, odometry: Odometry
) -> Decision:
    """The payload of a step.

    Args:
        step: what was seen, planned, driven and earned.
        time: seconds on the robot's clock, after the command.
        sequence: number of the step in its run, from 0.
        total_reinforcement: of the run, this step included.
        odometry: after the command.
    """
    seen = step.before.resonance
    return Decision(
        time=time,
        sequence=sequence,
        frame_time=step.before.frame.time,
        situation=Situation(
            node=int(seen.node),
            neuron=int(step.before.neuron),
            resonant=bool(seen.resonant),
            match=float(seen.match),
        ),
        alternatives=[
            Alternative(command=command.name, evaluation=value)
            for command, value in zip(COMMANDS, step.plan.evaluations, strict=True)
        ],
        command=COMMANDS[step.command].name,
        steps=step.plan.steps,
        sequence_ahead=[_ahead(neuron) for neuron in step.plan.sequence],
        reinforcement=step.reinforcement,
        total_reinforcement=total_reinforcement,
        collided=step.outcome.collided,
        infrared=list(step.outcome.proximity),
        odometry=odometry,
    )


def _ahead(neuron: int) -> Ahead:
    node, command = divmod(neuron, len(COMMANDS))
    return Ahead(node=node, command=COMMANDS[command].name)
