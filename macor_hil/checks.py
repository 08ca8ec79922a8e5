"""Checks for parts of one's own: run them in a test beside the part.

    from macor_hil.checks import check_planner
    from my_package import Mine

    def test_mine() -> None:
        check_planner(Mine)

Each makes the part from its default settings and raises `CheckError`, an AssertionError that says
what is wrong, at the first thing that `run`, `train` or an experiment would stumble over.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import isfinite
from typing import Any, Final

import numpy as np
from khepera_protocol.mirror import Mirror

from macor_hil.arrays import Array, Image, State
from macor_hil.commands import COMMANDS
from macor_hil.errors import CameraError
from macor_hil.hardware.cameras import Frame
from macor_hil.hardware.cameras.catalogue import make_camera
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import MEMORIES, build_brain
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.eyes.eyes import Eyes
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.settings import MindSettings, Part, make_part

_NODES: Final = 8
_FEATURES: Final = 12
_DIRECTIONS: Final = 120
_DRIVE: Final = 200
"""Commands of the made-up drive that parts learn from."""


class CheckError(AssertionError):
    """A part does not do what is asked of its kind."""


def check_planner(planner: Any, memory: Memory | None = None, **settings: Any) -> None:
    """Check a class of planners.

    Args:
        planner: the class.
        memory: an empty memory of the kind that it reads, where that is not in the catalogue.
        settings: other than the defaults.
    """
    made = make_part(planner, settings, {})
    name: Any = getattr(made, "memory", None)
    _expect(isinstance(name, str), "it has no attribute `memory`, the name of what it reads")
    brain = _brain({name: memory} if memory is not None else None, reads=name)
    _expect(name in brain.memories, f"it reads {name!r}; pass check_planner an empty memory")
    known = brain.memories[name]
    moments = [_moment(brain, x) for x in _inputs(20, brain.eyes.size)]
    _check_plan(made.plan(known, moments[0]), "an empty memory")
    for experience in _drive(brain):
        brain.learn(experience)
    before = _copy(known.state())
    for moment in moments:
        plan = made.plan(known, moment)
        _check_plan(plan, "a memory of a drive")
        _expect(
            plan.command is not None or all(value is None for value in plan.evaluations),
            "it evaluates commands and chooses none",
        )
        _expect(made.plan(known, moment) == plan, "the same moment gives two different plans")
    _expect(_same(before, known.state()), "planning changes the memory")


def check_memory(memory: Any, **settings: Any) -> None:
    """Check a class of memories."""

    def make() -> Memory:
        made: Memory = make_part(memory, settings, _given())
        made.tune(_inputs(50, _FEATURES), np.random.default_rng(1))
        return made

    first, second = make(), make()
    half = _DRIVE // 2
    drive = list(_drive(_brain(None, _FEATURES)))
    for experience in drive[:half]:
        first.learn(experience)
        second.learn(experience)
    _expect(_same(first.state(), second.state()), "the same experiences give different states")
    _check_state(first, make, "memory")
    third = make()
    third.load(_copy(first.state()))
    for experience in drive[half:]:
        first.learn(experience)
        third.learn(experience)
    _expect(_same(first.state(), third.state()), "it learns otherwise after it was stored")


def check_clusterer(clusterer: Any, **settings: Any) -> None:
    """Check a class of clusterers."""

    def make() -> Any:
        return make_part(clusterer, settings, _given())

    first, second = make(), make()
    inputs = _inputs(300, _FEATURES)
    for x in inputs:
        one, other = first.present(x, learn=True), second.present(x, learn=True)
        _expect(one == other, "the same inputs give different situations")
        _expect(0 <= one.node < first.size <= _NODES, f"node {one.node} of {first.size}")
        _expect(isfinite(one.match), "a match is not finite")
    before = _copy(first.state())
    for x in 0.9 * inputs:
        first.present(x, learn=False)
    _expect(_same(before, first.state()), "it learns although it is told not to")
    centres = np.asarray(first.centres())
    _expect(
        centres.shape == (first.size, _FEATURES) and bool(np.isfinite(centres).all()),
        f"centres of shape {centres.shape}, not ({first.size}, {_FEATURES}), or not finite",
    )
    _check_state(first, make, "clusterer")
    third = make()
    third.load(_copy(before))
    for x in inputs:
        _expect(
            third.present(x, learn=False) == first.present(x, learn=False),
            "it finds other situations after it was stored",
        )


def check_eyes(eyes: Any, **settings: Any) -> None:
    """Check a class of eyes."""
    mirror = Mirror()

    def make() -> Eyes:
        made: Eyes = make_part(eyes, settings, {"mirror": mirror})
        return made

    first = make()
    size = first.picture_size or (mirror.width, mirror.height)
    rng = np.random.default_rng(2)
    pictures: list[Image] = [
        rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8) for _ in range(20)
    ]
    raw = np.array([first.look(picture) for picture in pictures])
    _expect(bool(np.isfinite(raw).all()), "features are not finite")
    _expect((raw == [make().look(p) for p in pictures]).all(), "one picture, two sets of features")
    for moment in ("before", "after"):
        x = first.tuned(raw)
        _expect(x.shape == (len(pictures), first.size), f"features of shape {x.shape[1:]}")
        inside = bool(((x >= 0.0) & (x <= 1.0)).all())
        _expect(inside, f"features {moment} tuning are not in [0, 1]")
        _expect((x[0] == first.tuned(raw[0])).all(), "one frame is tuned otherwise than many")
        _expect(
            np.allclose(first.mirrored(first.mirrored(x)), x),
            "the mirror image of a mirror image is another picture",
        )
        first.tune(raw)
    _check_state(first, make, "eyes")
    again = make()
    again.load(_copy(first.state()))
    _expect((again.tuned(raw) == first.tuned(raw)).all(), "they see otherwise after being stored")
    if first.picture_size is not None:
        try:
            first.look(np.zeros((3, 5, 3), np.uint8))
        except CameraError:
            return
        raise CheckError("a picture of another size is looked at without a CameraError")


def check_camera(camera: Any, source: str = "", missing: str | None = None, **given: Any) -> None:
    """Check a class of cameras.

    Args:
        camera: the class.
        source: what it is to show; at least three pictures must come from there.
        missing: a source that there is not; None: there is none to try.
        given: the keywords `port`, `session` and `robot`, where its constructor has them.
    """
    made = make_camera(camera, source, **given)
    try:
        _expect(isinstance(getattr(made, "live", None), bool), "it does not say whether it is live")
        frames = [made.grab()]
        first = frames[0].image.copy()
        frames += [made.grab(), made.grab()]
        for frame in frames:
            _check_frame(frame, first.shape)
        _expect(np.array_equal(frames[0].image, first), "a picture changes after it was given")
        for before, after in pairwise(frames):
            _expect(after.sequence > before.sequence, "the pictures' numbers do not grow")
            _expect(after.time >= before.time, "the pictures' times go back")
    finally:
        made.close()
    if missing is not None:
        try:
            make_camera(camera, missing, **given).close()
        except CameraError:
            return
        raise CheckError(f"it opens {missing!r} without a CameraError")


def _check_frame(frame: object, shape: tuple[int, ...]) -> None:
    _expect(isinstance(frame, Frame), f"it gives {type(frame).__name__}, not a Frame")
    assert isinstance(frame, Frame)
    image = frame.image
    _expect(
        image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3,
        f"a picture is {image.dtype} of shape {image.shape}, not uint8 of (height, width, 3)",
    )
    _expect(image.shape == shape, f"pictures of shape {shape} and of shape {image.shape}")
    _expect(isfinite(frame.time), "a picture's time is not finite")


def _expect(holds: bool, what: str) -> None:
    if not holds:
        raise CheckError(what)


def _given() -> dict[str, Any]:
    return {
        "nodes": _NODES,
        "commands": len(COMMANDS),
        "features": _FEATURES,
        "mirrored": lambda x: x[..., ::-1],
        "directions": _DIRECTIONS,
    }


def _inputs(count: int, features: int) -> Array:
    """Make inputs along a few ways through the space, as a drive gives them."""
    rng = np.random.default_rng(3)
    corners = rng.uniform(size=(6, features))
    share = (np.arange(count) * 0.07)[:, None] % 1.0
    which = (np.arange(count) * 0.07).astype(int) % 5
    inputs: Array = corners[which] * (1 - share) + corners[which + 1] * share
    return inputs


def _brain(
    memories: dict[str, Memory] | None, features: int | None = None, reads: str = ""
) -> Brain:
    settings = MindSettings(nodes=_NODES)
    if reads in MEMORIES.builtin and reads not in settings.memories and memories is None:
        settings = replace(settings, memories={reads: Part(reads)})
    brain = build_brain(settings)
    if features is not None:
        brain.clusterer = make_part(type(brain.clusterer), {}, _given())
        brain.memories = {}
    if memories is not None:
        brain.memories = memories
    for x in _inputs(60, features or brain.eyes.size):
        brain.clusterer.present(x, learn=True)
    return brain


def _moment(brain: Brain, x: Array, command: int = 2) -> Moment:
    resonance = brain.clusterer.present(x, learn=False)
    # walls that come nearer with one feature or another
    floor = np.interp(np.linspace(0, len(x) - 1, _DIRECTIONS), np.arange(len(x)), 0.1 + x)
    return Moment(x, x, resonance, resonance.node * len(COMMANDS) + command, floor)


def _drive(brain: Brain) -> Iterator[Experience]:
    """Make up a drive with collisions; each experience begins where the one before ended."""
    rng = np.random.default_rng(4)
    features = brain.eyes.size if brain.memories else _FEATURES
    inputs = _inputs(_DRIVE + 1, features)
    before = _moment(brain, inputs[0])
    for x in inputs[1:]:
        command, collided = int(rng.integers(len(COMMANDS))), bool(rng.random() < 0.1)
        after = _moment(brain, x, command)
        earned = brain.earned(command, collided=collided)
        yield Experience(before, command, after, earned, collided)
        before = after


def _check_plan(plan: object, where: str) -> None:
    _expect(isinstance(plan, Plan), f"with {where} it gives {type(plan).__name__}, not a Plan")
    assert isinstance(plan, Plan)
    m, neurons = len(COMMANDS), _NODES * len(COMMANDS)
    _expect(len(plan.evaluations) == m, f"{len(plan.evaluations)} evaluations of {m} commands")
    _expect(
        all(value is None or isfinite(value) for value in plan.evaluations),
        f"with {where} an evaluation is not finite",
    )
    _expect(plan.command is None or plan.command in range(m), f"there is no command {plan.command}")
    known = [i for each in plan.hypotheses for i in each.neurons] + list(plan.sequence)
    _expect(all(i in range(neurons) for i in known), f"a neuron is not in 0 to {neurons - 1}")
    worth = [each.evaluation for each in plan.hypotheses]
    _expect(worth == sorted(worth, reverse=True), "hypotheses do not begin with the best")
    _expect(len(plan.activities) in (0, neurons), f"{len(plan.activities)} activities of {neurons}")


def _check_state(part: Any, make: Any, kind: str) -> None:
    state = part.state()
    _expect(
        all(isinstance(array, np.ndarray) for array in state.values()),
        f"the state of a {kind} holds something other than arrays",
    )
    again = make()
    again.load(_copy(state))
    _expect(_same(state, again.state()), "a stored state does not come back as it was")
    if not state:
        return
    try:
        make().load({})
    except (KeyError, ValueError):
        return
    raise CheckError("a state without its arrays is taken; raise KeyError or ValueError")


def _copy(state: State) -> State:
    return {name: array.copy() for name, array in state.items()}


def _same(one: State, other: State) -> bool:
    return one.keys() == other.keys() and all(
        np.array_equal(one[name], other[name]) for name in one
    )
