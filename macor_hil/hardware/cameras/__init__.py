"""Cameras by one string.

* `port`: the camera of the robot behind a `khepera://` port, in this process.
* `zenoh`: the emulator's camera of the robot of this name; `zenoh:KEY`: a source on a Zenoh key,
  asked for a picture, or heard if it answers no queries; the one that alone answers at first.
* `video:0`, `video:/dev/video0`: a video device, or a stream such as `video:rtsp://...`; always
  its newest picture, and opened again when it has gone or is silent.
* `video:drive.mp4`: a video file, one picture after the other.
* `images:FOLDER`: the pictures of a folder in the order of their names.
"""

from typing import Any

import zenoh

from macor_hil.errors import CameraError
from macor_hil.hardware.cameras.camera import Camera, Frame
from macor_hil.hardware.cameras.files import ImagesCamera, VideoFileCamera
from macor_hil.hardware.cameras.live_video import LiveVideoCamera, is_device
from macor_hil.hardware.cameras.port_camera import PortCamera
from macor_hil.hardware.cameras.zenoh_camera import ZenohCamera

__all__ = ["Camera", "Frame", "PortCamera", "ZenohCamera", "open_camera"]


def open_camera(name: str, *, port: Any, session: zenoh.Session | None, robot: str) -> Camera:
    """The camera of a string; see the module's text.

    Raises:
        CameraError: no such kind of camera, or it cannot be opened.
    """
    kind, _, rest = name.partition(":")
    if kind == "port" and not rest:
        return PortCamera(port)
    if kind == "video" and rest:
        return LiveVideoCamera(rest) if is_device(rest) else VideoFileCamera(rest)
    if kind == "images" and rest:
        return ImagesCamera(rest)
    if kind == "zenoh":
        if session is None:
            raise CameraError(f"the camera {name!r} needs Zenoh, which is switched off")
        return ZenohCamera(session, rest or f"khepera/{robot}/camera")
    raise CameraError(
        f"unknown camera {name!r}; give port, zenoh[:KEY], video:DEVICE, video:FILE or"
        " images:FOLDER"
    )
