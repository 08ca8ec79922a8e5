"""Addresses of serial ports and cameras."""

from pathlib import Path

import pytest

from macor_hil.errors import CameraError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.cameras.catalogue import CameraAddress

EMBEDDED = PortAddress.parse("khepera://corridor?seed=1")
DEVICE = PortAddress.parse("/dev/ttyUSB0")


@pytest.mark.parametrize(
    ("text", "embedded", "limits_writes", "is_device"),
    [
        ("khepera://corridor?seed=1", True, False, False),
        ("/dev/ttyUSB0", False, False, True),
        ("runs/khepera", False, False, True),
        ("socket://127.0.0.1:7000", False, False, False),
        ("rfc2217://127.0.0.1:7000", False, True, False),
        ("spy://khepera://corridor", False, False, False),
        ("", False, False, True),
    ],
)
def test_ports(text: str, embedded: bool, limits_writes: bool, is_device: bool) -> None:
    port = PortAddress.parse(text)
    assert str(port) == text
    found = port.embedded, port.limits_writes, port.is_device
    assert found == (embedded, limits_writes, is_device)


@pytest.mark.parametrize(
    ("text", "port", "kind", "source"),
    [
        ("auto", EMBEDDED, "port", ""),
        ("auto", DEVICE, "zenoh", ""),
        ("port", DEVICE, "port", ""),
        ("zenoh:any/key", DEVICE, "zenoh", "any/key"),
        ("video:rtsp://host:554/a", DEVICE, "video", "rtsp://host:554/a"),
        ("images:folder", DEVICE, "images", "folder"),
        ("my_package.eyes:Mine", DEVICE, "my_package.eyes:Mine", ""),
        ("my_package:Outer.Mine:0", DEVICE, "my_package:Outer.Mine", "0"),
        ("my/file.py:Mine:rtsp://host:554/a", DEVICE, "my/file.py:Mine", "rtsp://host:554/a"),
    ],
)
def test_cameras(text: str, port: PortAddress, kind: str, source: str) -> None:
    assert CameraAddress.parse(text, port) == CameraAddress(kind, source)


def test_cameras_say_what_they_need() -> None:
    known = {name: CameraAddress(name) for name in ("port", "zenoh", "video", "images")}
    assert [name for name, each in known.items() if each.needs_session] == ["zenoh"]
    assert [name for name, each in known.items() if each.needs_port] == ["port"]
    assert [name for name, each in known.items() if each.is_emulated] == ["zenoh"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("eye", "unknown camera 'eye'; give port"),
        ("", "unknown camera"),
        ("eye:0", "unknown camera 'eye:0'"),
        ("port:0", "unknown camera 'port:0'"),
        ("video", "unknown camera 'video'"),
        ("images:", "unknown camera 'images'"),
        ("zenoh", "needs Zenoh, which is switched off"),
        ("no_such_module:Mine", "cannot load the camera 'no_such_module:Mine'"),
        ("none.py:Mine:0", "there is no Python file"),
    ],
)
def test_cameras_that_there_are_not(text: str, says: str) -> None:
    with pytest.raises(CameraError, match=says):
        CameraAddress.parse(text).open()


def test_a_camera_of_a_file_gets_what_it_asks_for(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "class Mine:\n    def __init__(self, robot, source='front'):\n"
        "        self.given = robot, source\n"
    )
    for text, source in ((f"{file}:Mine", "front"), (f"{file}:Mine:back:left", "back:left")):
        camera = CameraAddress.parse(text).open(robot="robby")
        assert camera.given == ("robby", source)  # type: ignore[attr-defined]
