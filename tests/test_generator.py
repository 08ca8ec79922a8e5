"""Arenas made from a seed, and varied: the same each time, sensible, and with a way."""

import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from as_type import not_none
from hypothesis import given
from hypothesis import strategies as st
from khepera_protocol.text import parse_toml, printable
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.app.cli.commands import app
from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.arenas.arena_text import arena_text
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA
from khepera_emulator.routes.generator import COMMANDS, Generated, generate
from khepera_emulator.routes.layout import Difficulty, Kind, Post, Stretch, draw_layout
from khepera_emulator.routes.oracle import MARGIN, PAPER_COMMANDS, Oracle
from khepera_emulator.routes.passages import Passage, faces, walls
from khepera_emulator.routes.variants import own_colour, with_own_colours
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import check_room, pose_of, random_pose
from khepera_emulator.world.outline import outline
from macor_hil.commands import COMMANDS as MOTOR_COMMANDS
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.runs.trials import Spread

GOLDEN = Path(__file__).parent / "golden" / "generated.toml"
SEEDS = (0, 6, 12, 3, 9)
"""One of each kind, and at least one of each difficulty."""

OPEN_BOX = load_arena("open-box")


def read(text: str) -> Arena:
    return Arena.model_validate(parse_toml(text.encode()))


@pytest.fixture(scope="module")
def made() -> dict[int, Generated]:
    return {seed: generate(seed) for seed in SEEDS}


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    app(["arenas", *arguments], prog_name="khepera-emulator", standalone_mode=False)
    return capsys.readouterr().out


def test_the_same_seed_makes_the_same_text(request: pytest.FixtureRequest) -> None:
    text = generate(7, own_colours=True).text
    if request.config.getoption("--update-golden"):
        GOLDEN.write_text(text)
    assert text == GOLDEN.read_text()


def test_the_kind_and_the_difficulty_change_from_seed_to_seed(made: dict[int, Generated]) -> None:
    titles = [made[seed].arena.title for seed in SEEDS]
    assert titles == [
        "Generated from seed 0: bends, easy",
        "Generated from seed 6: s-curve, medium",
        "Generated from seed 12: hairpin, hard",
        "Generated from seed 3: junctions, easy",
        "Generated from seed 9: posts, medium",
    ]


def test_their_text_is_the_arena(made: dict[int, Generated]) -> None:
    for arena, text in made.values():
        assert read(text) == arena


def test_the_command_in_its_head_makes_it(
    made: dict[int, Generated], capsys: pytest.CaptureFixture[str]
) -> None:
    for number in (3, 12):
        program, verb, *arguments = shlex.split(made[number].text.splitlines()[0].strip("# "))
        assert (program, verb) == ("khepera-emulator", "arenas")
        assert run(capsys, *arguments) == made[number].text


def test_a_way_is_possible_from_the_start_and_near_it(made: dict[int, Generated]) -> None:
    rng = np.random.default_rng(0)
    for arena, _ in made.values():
        oracle, start = Oracle(outline(arena, KHEPERA), margin=2 * MARGIN), pose_of(arena.start)
        for place in (start, Spread().draw(start, rng), Spread().draw(start, rng)):
            assert oracle.longest_drive(place, COMMANDS).length == COMMANDS


def test_straight_on_the_robot_collides_when_the_head_says_so(made: dict[int, Generated]) -> None:
    for arena, text in made.values():
        straight = Oracle(outline(arena, KHEPERA), (PAPER_COMMANDS[-1],))
        length = straight.longest_drive(pose_of(arena.start), COMMANDS).length
        assert f"collides after {length} commands" in text
        assert 5 <= length <= 26


def test_robots_find_room_in_all_of_the_free_strip(made: dict[int, Generated]) -> None:
    for arena, _ in made.values():
        plan = FloorPlan(arena)

        def gap(pose: Pose, plan: FloorPlan = plan) -> float:
            return plan.clearance(pose.x, pose.y) - KHEPERA.radius

        check_room(pose_of(arena.start), gap)
        rng = np.random.default_rng(1)
        for _ in range(30):
            random_pose(arena.free, gap, rng)
        for begin, end in pairwise(arena.free.points):
            for x, y in np.linspace(begin, end, 20):
                inside = plan.clearance(x, y)
                assert inside > -0.03  # a post may stand there
        (x0, y0), (x1, y1) = plan.bounds()
        assert max(x1 - x0, y1 - y0) < 3.0


def test_corridors_are_as_wide_as_the_head_says(made: dict[int, Generated]) -> None:
    for number in (0, 6, 12):
        arena, text = made[number]
        rows = [line.split() for line in text.splitlines() if line.count(" cm") == 2]
        widths = [float(row[-2]) / 100 for row in rows]
        plan = FloorPlan(arena.model_copy(update={"cylinder": []}))
        for (begin, end), width in zip(pairwise(arena.free.points), widths, strict=True):
            (x0, y0), (x1, y1) = begin, end
            middle = plan.clearance((x0 + x1) / 2, (y0 + y1) / 2)
            assert middle == pytest.approx(width / 2, abs=1e-9)


def test_a_robot_drives_its_way(made: dict[int, Generated], tmp_path: Path) -> None:
    path = tmp_path / "made.toml"
    path.write_text(made[12].text)
    with open_hardware(f"khepera://{path}?drift=none") as hardware:
        found = Oracle(not_none(hardware.bench).outline()).longest_drive(
            not_none(hardware.bench).truth().pose, 40
        )
        driver = Driver(hardware.robot)
        driver.start()
        assert not any(driver.execute(MOTOR_COMMANDS[c]).collided for c in found.commands)


@given(seed=st.integers(0, 2**32), kind=st.sampled_from(Kind), hard=st.sampled_from(Difficulty))
def test_layouts_do_not_run_into_themselves(seed: int, kind: Kind, hard: Difficulty) -> None:
    layout = draw_layout(np.random.default_rng(seed), kind, hard)
    if layout is None:
        return
    lines = faces(layout.floors)
    assert len(lines) == 1  # nothing is closed off, and nothing goes round
    corners = lines[0][:-1]
    assert len(set(corners)) == len(corners)
    assert all(a[0] == b[0] or a[1] == b[1] for a, b in pairwise(lines[0]))
    for stretch, post in layout.posts:
        assert isinstance(post, Post)
        along, aside = beside(layout.way[stretch], post)
        assert 0 <= along <= layout.way[stretch].length
        assert abs(aside) + post.radius < layout.way[stretch].width / 2
    for cut in layout.cuts.values():
        (ax, ay), (bx, by) = cut
        assert abs(ax - bx) == abs(ay - by) > 0  # across the corner


def beside(stretch: Stretch, post: Post) -> tuple[int, int]:
    (x0, y0), (x1, y1) = stretch.at(0), stretch.at(1)
    dx, dy = post.x - x0, post.y - y0
    return dx * (x1 - x0) + dy * (y1 - y0), dy * (x1 - x0) - dx * (y1 - y0)


def test_the_faces_of_a_corner() -> None:
    line = [(0, 0), (30, 0), (30, 40), (20, 40), (20, 10), (0, 10), (0, 0)]
    assert faces([Passage(0, 0, 30, 10), Passage(20, 0, 30, 40)]) == [line]


def test_the_faces_of_a_ring() -> None:
    ring = [
        Passage(0, 0, 40, 10),
        Passage(30, 0, 40, 40),
        Passage(0, 30, 40, 40),
        Passage(0, 0, 10, 40),
    ]
    around, island = faces(ring)
    assert around == [(0, 0), (40, 0), (40, 40), (0, 40), (0, 0)]
    assert island == [(10, 10), (10, 30), (30, 30), (30, 10), (10, 10)]
    assert walls(around, 4) == [(-2, -2), (42, -2), (42, 42), (-2, 42), (-2, -2)]
    assert walls(island, 4) == [(12, 12), (12, 28), (28, 28), (28, 12), (12, 12)]


def test_a_passage_is_near_what_is_less_than_a_gap_away() -> None:
    here = Passage(0, 0, 10, 10)
    assert here.is_near(Passage(14, 3, 20, 5), 5)
    assert not here.is_near(Passage(15, 3, 20, 5), 5)
    assert here.is_near(Passage(5, 5, 6, 6), 0)


@pytest.mark.parametrize("name", arena_names())
def test_every_arena_can_be_written_down(name: str) -> None:
    arena = load_arena(name)
    head, notes = ["A comment", ""], {("wall", 1): "the second wall"}
    text = arena_text(arena, head, notes)
    assert read(text) == arena
    assert text.startswith("# A comment\n#\nversion = 1\n")
    assert ("# the second wall\n[[wall]]" in text) == (len(arena.wall) > 1)
    assert max(map(len, text.splitlines())) <= 100


@given(st.text(max_size=30))
def test_any_title_can_be_written_down(title: str) -> None:
    arena = OPEN_BOX.model_copy(update={"title": title})
    assert read(arena_text(arena)).title == printable(title)


@pytest.mark.parametrize("name", arena_names())
def test_walls_of_their_own_colours_stand_where_they_stood(name: str) -> None:
    arena = load_arena(name)
    varied = with_own_colours(arena)
    before, after = FloorPlan(arena), FloorPlan(varied)
    assert [(b.x, b.y, b.half_length, b.half_thickness) for b in before.boxes] == [
        (b.x, b.y, b.half_length, b.half_thickness) for b in after.boxes
    ]
    colours = {box.colour for box in after.boxes}
    assert len(colours) == len(after.boxes)
    assert {round(sum(colour) / 3, 2) for colour in colours} == {0.6}
    assert varied.start == arena.start
    assert varied.cylinder == arena.cylinder


def test_a_hundred_colours_differ() -> None:
    colours = [own_colour(number) for number in range(100)]
    assert len(set(colours)) == 100
    assert all(0.0 <= part <= 1.0 for colour in colours for part in colour)
    for here, there in pairwise(colours):
        assert max(abs(a - b) for a, b in zip(here, there, strict=True)) > 0.25


def test_the_command_line_makes_varies_and_draws(
    made: dict[int, Generated], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, drawing = tmp_path / "made.toml", tmp_path / "made.png"
    assert run(capsys, "--generate", "3", "--out", str(out), "--draw", str(drawing)) == ""
    assert out.read_text() == made[3].text
    assert drawing.read_bytes().startswith(b"\x89PNG")
    assert "Generated from seed 3: junctions, easy" in run(capsys, str(out))
    assert read(run(capsys, str(out), "--own-colours")) == with_own_colours(made[3].arena)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["maze", "--generate", "2"], "leave out maze"),
        (["maze", "--kind", "bends"], "for an arena that --generate makes"),
        (["--difficulty", "hard"], "for an arena that --generate makes"),
        (["--out", "x.toml"], "for one arena: name it"),
        (["--own-colours"], "for one arena: name it"),
        (["maze", "--out", "{folder}/nowhere/x.toml"], "cannot write .*nowhere"),
    ],
)
def test_what_does_not_go_together_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    with pytest.raises(EmulatorError, match=says):
        run(capsys, *(each.replace("{folder}", str(tmp_path)) for each in arguments))


def test_the_hairpin_is_as_it_says() -> None:
    arena = load_arena("hairpin")
    drawing, start = outline(arena, KHEPERA), pose_of(arena.start)
    straight = Oracle(drawing, (PAPER_COMMANDS[-1],))
    assert straight.longest_drive(start, COMMANDS).length == 24
    rng = np.random.default_rng(0)
    oracle = Oracle(drawing, margin=2 * MARGIN)
    for _ in range(10):
        place = Spread().draw(start, rng)
        assert oracle.longest_drive(place, COMMANDS).length == COMMANDS
