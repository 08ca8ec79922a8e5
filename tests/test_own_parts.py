"""Parts of another distribution, and of a file: found, listed, checked and driven by."""

import subprocess
import sys
from pathlib import Path

import pytest
from emulator_process import PATIENCE, emulator
from khepera_protocol.registry import Registry, RegistryError

from macor_hil.hardware.cameras.catalogue import CAMERAS
from macor_hil.mind.catalogue import CLUSTERERS, EYES, PLANNERS, build_brain, make_planner
from macor_hil.mind.settings import MindSettings, Part

OWN = Path(__file__).parents[1] / "examples" / "own_parts"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example distribution, installed into a folder of its own."""
    target = tmp_path_factory.mktemp("site")
    source = tmp_path_factory.mktemp("source")
    for file in OWN.rglob("*"):
        if file.suffix in (".py", ".toml"):
            copy = source / file.relative_to(OWN)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target"]
    pip = [sys.executable, "-m", "pip", "install", *options, str(target), str(source)]
    subprocess.run(pip, check=True, timeout=100)
    return target


@pytest.fixture
def found(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(installed))


@pytest.mark.usefixtures("found")
def test_parts_of_another_distribution_are_listed_and_pass_their_checks() -> None:
    from macor_hil.checks import check_camera, check_clusterer, check_eyes, check_planner

    assert "wary" in PLANNERS.names()
    check_planner(PLANNERS.find("wary"))
    check_clusterer(CLUSTERERS.find("leader"))
    check_eyes(EYES.find("grey"))
    check_eyes(EYES.find("grey"), sectors=12)
    check_camera(CAMERAS.find("pattern"), missing="many")
    check_camera(CAMERAS.find("pattern"), "30")


@pytest.mark.usefixtures("found")
def test_a_brain_of_foreign_parts_is_kept_in_a_map(tmp_path: Path) -> None:
    from macor_hil.mind.map_file import load_map, save_map

    settings = MindSettings(eyes=Part("grey", {"sectors": 20}), clusterer=Part("leader"))
    brain = build_brain(settings)
    save_map(tmp_path / "a.npz", brain, {})
    again, _ = load_map(tmp_path / "a.npz")
    assert again.settings == settings
    assert again.eyes.size == 20


@pytest.mark.long
def test_the_command_line_lists_them_and_drives_by_them(installed: Path, tmp_path: Path) -> None:
    def call(*arguments: str) -> str:
        program = [sys.executable, "-m", "macor_hil.cli", *arguments]
        environment = {"PATH": "/usr/bin", "PYTHONPATH": str(installed), "COLUMNS": "200"}
        done = subprocess.run(
            program, capture_output=True, text=True, timeout=100, env=environment, cwd=tmp_path
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "wary" in call("run", "--help")
    call("train", "--map", "a.npz", "--tuning", "20", "--random", "60")
    run = ("run", "--map", "a.npz", "--commands", "2", "--port", "khepera://open-box")
    assert "2 commands" in call(*run, "--planner", "wary")
    assert "2 commands" in call(*run, "--planner", f"{OWN / 'own_parts' / 'planner.py'}:Wary")
    assert "pattern" in call("look", "--help")
    for camera in ("pattern:30", f"{OWN / 'own_parts' / 'camera.py'}:PatternCamera:30"):
        call("look", "--camera", camera, "--picture", "a.png")
        assert (tmp_path / "a.png").stat().st_size > 1000
        (tmp_path / "a.png").unlink()
    assert "wary" in call("trials", "--map", "a.npz", "--trials", "1", "--planner", "wary")


@pytest.mark.usefixtures("found")
def test_a_turret_of_another_distribution_is_listed_checked_and_talked_to() -> None:
    import serial

    import khepera_emulator  # noqa: F401 - registers khepera://
    from khepera_emulator.checks import check_turret
    from khepera_emulator.turrets.catalogue import TURRET_CLASSES

    assert TURRET_CLASSES.names()[-1] == "compass"
    check_turret(TURRET_CLASSES.find("compass"))
    url = "khepera://open-box?turret=compass&turret=k213"
    with serial.serial_for_url(url, timeout=1) as port:
        port.write(b"T,40,B\nT,40,H\nnet\n")
        assert port.readline() == b"t,40,b,1,0\r\n"
        assert port.readline().startswith(b"t,40,h,")
        assert port.readline() == b"Turret N. 00000040  Compass: the heading to two degrees\r\n"


def test_the_emulator_lists_and_mounts_a_turret(installed: Path, tmp_path: Path) -> None:
    program = [sys.executable, "-m", "khepera_emulator.app.cli", "run"]
    environment = {"PATH": "/usr/bin", "PYTHONPATH": str(installed), "COLUMNS": "200"}
    said = subprocess.run([*program, "--help"], capture_output=True, text=True, env=environment)
    assert "general-io, compass" in said.stdout
    log, turret = tmp_path / "wire.jsonl", f"{OWN / 'own_parts' / 'turret.py'}:Compass"
    with emulator("--no-zenoh", "--turret", turret, "--record", str(log)) as running:
        import serial

        with serial.Serial(running.path, timeout=PATIENCE) as port:
            port.write(b"T,40,B\n")
            assert port.readline() == b"t,40,b,1,0\r\n"
    replay = [sys.executable, "-m", "khepera_emulator.app.cli", "replay", str(log)]
    refused = subprocess.run(replay, capture_output=True, text=True)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "uses code of its own" in refused.stderr
    allowed = subprocess.run([*replay, "--allow", turret], capture_output=True, text=True)
    assert (allowed.returncode, allowed.stdout) == (0, "1 reply lines equal\n"), allowed.stderr


def test_a_setting_that_is_out_of_range_is_named() -> None:
    from macor_hil.errors import MacorError

    with pytest.raises(MacorError, match=r"settings of FuzzyArt: vigilance should be less"):
        build_brain(MindSettings(clusterer=Part("fuzzy-art", {"vigilance": 2})))
    with pytest.raises(MacorError, match="settings of Anticipative: steps: Extra"):
        make_planner("anticipative", steps=3)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("grated", "there is no planner 'grated'; did you mean graded?"),
        ("json:Nothing", "has no attribute 'Nothing'"),
        ("no_such_module:Class", "No module named 'no_such_module'"),
        ("there/is/none.py:Class", "there is no Python file"),
        (":", "cannot load the planner ':'"),
        (".:Class", "cannot load the planner '.:Class'"),
        ("\x1b[2J", r"there is no planner '\\x1b"),
    ],
)
def test_a_part_that_cannot_be_found_is_a_sentence(name: str, says: str) -> None:
    with pytest.raises(RegistryError, match=says) as caught:
        PLANNERS.find(name)
    assert str(caught.value).isprintable()


def test_a_file_is_imported_once(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("class Mine: ...\n")
    registry = Registry("part", "none.such", {})
    assert registry.find(f"{file}:Mine") is registry.find(f"{file}:Mine")
    file.with_name("broken.py").write_text("def (\n")
    with pytest.raises(RegistryError, match=r"cannot load the part .* invalid syntax"):
        registry.find(f"{tmp_path}/broken.py:Mine")
