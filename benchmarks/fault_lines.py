"""Faults of the serial line: a live run through each, and a training."""

from pathlib import Path
from typing import Any, Final, NamedTuple

from fault_trainings import lost_in_training
from rig import MOVING, STANDING, longest_stretch, rig

_BEGIN: Final = 20.0
"""Seconds on the robot's clock: by then a controller drives."""

_LASTS: Final = 15.0
"""Seconds of a fault that hits again and again."""

_ATTEMPTS: Final = 3


class LineFault(NamedTuple):
    """A fault of the line; `seconds` of one that happens once, None of one by chance."""

    name: str
    spec: str
    seconds: float | None = None


_CHANCE: Final = f"at={_BEGIN},for={_LASTS}"
LINES: Final = (
    LineFault("line drops one byte in 200", f"drop:p=0.005,{_CHANCE}"),
    LineFault("line bends one byte in 200", f"flip:p=0.005,{_CHANCE}"),
    LineFault("line doubles one byte in 200", f"duplicate:p=0.005,{_CHANCE}"),
    LineFault("line delays one byte in 200 by 0.3 s", f"delay:p=0.005,time=0.3,{_CHANCE}"),
    LineFault("line truncates one reply in 20", f"truncate:p=0.05,{_CHANCE}"),
    LineFault("foreign text before one reply in 20", f"stray:p=0.05,{_CHANCE}"),
    LineFault("line stalls for 1 s", f"stall:at={_BEGIN},for=1", 1.0),
    LineFault("line cut for 2 s", f"cut:at={_BEGIN},for=2", 2.0),
    LineFault("robot reset in mid-command", f"reset:at={_BEGIN}", 0.0),
)


def line_row(folder: Path, trained: Path, fault: LineFault) -> tuple[str, ...]:
    """Stood within, driving again within, decisions and transitions lost, what became of it."""
    with rig(folder, "--fault", fault.spec) as bench:
        for _ in range(_ATTEMPTS):
            begin = bench.make_ready() + _BEGIN  # the fault's times count from the reset
            # a slow robot, so that one that only ends its command shows
            speed = {} if fault.seconds is None else {"speed": 2}
            controller = bench.controller(trained, planner="circle", **speed)
            controller.wait_for_steps(1)
            samples = bench.motion(begin)
            if _drove_into_it(samples, fault):
                break
        else:
            return "fell while the robot stood", "-", "-", "-", "-"
        samples += bench.motion(begin + _LASTS)
        times = _times(samples, fault, begin)
        lost, ending = end_of(controller)
    return *times, lost, _training(folder, fault), ending


def end_of(controller: Any) -> tuple[str, str]:
    """Decisions lost, and what became of the run."""
    if controller.process.poll() is None:
        controller.process.terminate()
    said = controller.end()
    ending, _, lost = said.rpartition(" ")
    if not lost.isdecimal():
        return "-", f"ended: {said[:60]}"
    return lost, "went on" if ending.startswith("interrupted") else f"ended: {ending.strip()}"


def _drove_into_it(samples: list[tuple[float, float]], fault: LineFault) -> bool:
    if fault.seconds is None:
        return len(samples) > 1
    return len(samples) > 1 and samples[-1][1] > MOVING


def _times(samples: list[tuple[float, float]], fault: LineFault, begin: float) -> tuple[str, str]:
    faulty = [sample for sample in samples if sample[0] >= begin]
    if fault.seconds is None:
        # whenever it hits, wheels turn no longer than this, nor stand longer
        turned, stood = (longest_stretch(faulty, moving=moving) for moving in (True, False))
        return f"{turned:.2f} s", f"{stood:.1f} s"
    rest = next((now for now, speed in faulty if speed < STANDING), None)
    if rest is None:
        return "did not", "-"
    over = max(begin + fault.seconds, rest)
    again = next((now for now, speed in faulty if now > over and speed > MOVING), None)
    back = "did not" if again is None else f"{again - begin - fault.seconds:.1f} s"
    return f"{rest - begin:.2f} s", back


def _training(folder: Path, fault: LineFault) -> str:
    port = f"khepera://open-box?seed=1&fault={fault.spec}"
    return lost_in_training(folder / "line.npz", port)
