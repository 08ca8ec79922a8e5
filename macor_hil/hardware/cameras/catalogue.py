"""Cameras by name, and addresses of cameras.

* `port`: the camera of the robot behind a `khepera://` port, in this process.
* `own`: the robot's own camera over its own line, of an e-puck; it looks ahead: `--eyes front`.
* `zenoh`: the emulator's camera of the robot of this name; `zenoh:KEY`: a source on a Zenoh key,
  asked for a picture, or heard if it answers no queries; the one that alone answers at first.
* `video:0`, `video:/dev/video0`: a video device, or a stream such as `video:rtsp://...`; always
  its newest picture, and opened again when it has gone or is silent.
* `video:drive.mp4`: a video file, one picture after the other.
* `images:FOLDER`: the pictures of a folder in the order of their names.
* `NAME[:SOURCE]`, `package.module:Class[:SOURCE]`, `file.py:Class[:SOURCE]`: a camera of another
  distribution or of your own.

A camera is made with those of the keywords `source`, `port`, `client`, `session` and `robot` that
its constructor has: the text after its name, the robot's open serial port, the robot itself, a
Zenoh session and the robot's name.
"""

from dataclasses import dataclass
from inspect import Parameter, signature
from typing import Any, Final

import zenoh
from khepera_protocol.registry import Registry, RegistryError
from khepera_protocol.text import quoted

from macor_hil.errors import CameraError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.cameras.camera import Camera

CAMERAS: Final = Registry(
    "camera",
    "khepera_macor.cameras",
    {
        "port": "macor_hil.hardware.cameras.port_camera:PortCamera",
        "own": "macor_hil.hardware.cameras.port_camera:OwnCamera",
        "zenoh": "macor_hil.hardware.cameras.zenoh_camera:open_zenoh_camera",
        "video": "macor_hil.hardware.cameras.live_video:open_video_camera",
        "images": "macor_hil.hardware.cameras.files:ImagesCamera",
    },
)

AUTO: Final = "auto"
_USUAL: Final = "port, own, zenoh[:KEY], video:DEVICE, video:FILE or images:FOLDER"


@dataclass(frozen=True, slots=True)
class CameraAddress:
    """A kind of camera, and what it is to show.

    Attributes:
        kind: a name in `CAMERAS`, or `module:Class`, or `file.py:Class`.
        source: the text after it, such as a device; empty: none.
    """

    kind: str
    source: str = ""

    @classmethod
    def parse(cls, text: str, port: PortAddress | None = None) -> "CameraAddress":
        """Parse an address.

        Args:
            text: such as `video:0`; `auto` is the port's own camera where it has one, and the
                emulator's Zenoh key elsewhere.
            port: where the robot is.

        Raises:
            CameraError: there is no such kind of camera.
        """
        if text == AUTO:
            return cls("port" if port is not None and port.embedded else "zenoh")
        kind, _, source = text.partition(":")
        if kind in CAMERAS.names():
            return cls(kind, source)
        attribute, _, rest = source.partition(":")
        if kind and attribute.replace(".", "_").isidentifier():
            return cls(f"{kind}:{attribute}", rest)
        raise CameraError(f"unknown camera {quoted(text, 200)}; give {_all_kinds()}")

    def __str__(self) -> str:
        return f"{self.kind}:{self.source}" if self.source else self.kind

    @property
    def is_emulated(self) -> bool:
        """True for the camera of an emulator daemon, which has a bench beside it."""
        return self.kind == "zenoh"

    @property
    def needs_session(self) -> bool:
        """True where the camera is reached over Zenoh.

        Raises:
            CameraError: a camera of somebody's own cannot be loaded.
        """
        return "session" in signature(self._load()).parameters

    @property
    def needs_port(self) -> bool:
        """True where the camera is reached through the robot's serial port.

        Raises:
            CameraError: a camera of somebody's own cannot be loaded.
        """
        return "port" in signature(self._load()).parameters

    @property
    def needs_client(self) -> bool:
        """True where the camera is the robot's own.

        Raises:
            CameraError: a camera of somebody's own cannot be loaded.
        """
        return "client" in signature(self._load()).parameters

    def open(
        self,
        *,
        port: Any = None,
        client: Any = None,
        session: zenoh.Session | None = None,
        robot: str = "khepera",
    ) -> Camera:
        """Open the camera.

        Args:
            port: the robot's open serial port.
            client: the robot.
            session: Zenoh session of cameras that are reached over one.
            robot: the robot's name in Zenoh keys.

        Raises:
            CameraError: the camera cannot be loaded or opened.
        """
        make = self._load()
        wanted = signature(make).parameters
        if not _fits(wanted.get("source"), self.source):
            raise CameraError(f"unknown camera {quoted(str(self), 200)}; give {_all_kinds()}")
        if "session" in wanted and session is None:
            raise CameraError(f"the camera {str(self)!r} needs Zenoh, which is switched off")
        given = {"port": port, "client": client, "session": session, "robot": robot}
        return make_camera(make, self.source, **given)

    def _load(self) -> Any:
        try:
            return CAMERAS.find(self.kind)
        except RegistryError as error:
            raise CameraError(str(error)) from error


def make_camera(make: Any, source: str, **given: Any) -> Camera:
    """Make a camera with those keywords that its constructor has; no source: its own default."""
    wanted = signature(make).parameters
    values = {**given, "source": source} if source else given
    camera: Camera = make(**{name: values[name] for name in values if name in wanted})
    return camera


def open_camera(
    name: str, *, port: Any = None, session: zenoh.Session | None = None, robot: str = "khepera"
) -> Camera:
    """Open the camera of an address; see `CameraAddress`.

    Raises:
        CameraError: there is no such kind of camera, or it cannot be opened.
    """
    return CameraAddress.parse(name).open(port=port, session=session, robot=robot)


def _fits(wanted: Parameter | None, source: str) -> bool:
    """Return whether a source is given where one is wanted, and not where none is."""
    if wanted is None:
        return not source
    return bool(source) or wanted.default is not Parameter.empty


def _all_kinds() -> str:
    own = [name for name in CAMERAS.names() if name not in CAMERAS.builtin]
    others = f"; or {', '.join(own)}" if own else ""
    return f"{_USUAL}{others}; or a class as module:Class or file.py:Class"
