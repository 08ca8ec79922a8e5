"""The robot's view: mirror image and panorama, with the receptive fields drawn in."""

import base64
from functools import lru_cache
from math import cos, exp, pi, sin
from typing import Final

import cv2
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import Eye, Fields, Goal

from macor_hil.arrays import Image
from macor_hil.errors import CameraError
from macor_hil.hardware.cameras.decoding import check_picture, decode_picture
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper
from macor_hil.monitor.dashboard.svg import BEST, FAINT, drawing, element, heat, label, points, tip
from macor_hil.monitor.goals import goal_seen
from macor_hil.monitor.robot_state import RobotState

_SIZE: Final = PanoramaSize(columns=360, rows=80)
_FIELD_ROWS: Final = 46
_CURVE_STEP: Final = 6

_COMPLAINT: Final = "a frame is no picture"

_CAPTION: Final = 16
_MARGIN: Final = 22
"""Room for names at the left."""


def mirror(watched: RobotState) -> str:
    """Draw the mirror image, straight ahead up, with the borders of the receptive fields."""
    learned = watched.controlled.learned
    eye = _mirror_of(learned.eye if learned else None)
    shapes = [_picture(watched.frame, eye.width, eye.height)] if _is_picture(watched.frame) else []
    shapes += [
        element(
            "circle",
            cx=eye.centre_x,
            cy=eye.centre_y,
            r=r,
            fill="none",
            stroke=BEST,
            stroke_width=0.6,
            opacity=0.7,
        )
        for r in (eye.inner, eye.outer)
    ]
    for k in range(learned.fields.sectors if learned else 0):
        # borders lie half a field beside the centres
        azimuth = pi - 2 * pi * k / learned.fields.sectors  # type: ignore[union-attr]
        ends = [
            (eye.centre_x - r * sin(azimuth), eye.centre_y - r * cos(azimuth))
            for r in (eye.inner, eye.outer)
        ]
        shapes.append(
            element("polyline", points=points(ends), stroke=BEST, stroke_width=0.5, opacity=0.6)
        )
    title = "mirror image of the camera, straight ahead up"
    return drawing(eye.width, eye.height, *shapes, title=title)


def panorama(watched: RobotState) -> str:
    """Draw the unwrapped image, the fields' profiles over it, and their features below."""
    learned, decision = watched.controlled.learned, watched.controlled.decision
    columns, rows = _SIZE.columns, _SIZE.rows
    shapes = []
    if watched.frame and (unwrapped := _unwrapped(watched.frame, learned.eye if learned else None)):
        shapes.append(_picture(unwrapped, columns, rows))
    if decision and decision.goal and decision.goal.bearing is not None:
        shapes.append(_aim(decision.goal, decision.goal.bearing))
    height: float = rows + _CAPTION
    if learned:
        shapes += _profiles(learned.fields)
        features = decision.features if decision else []
        if features and len(features) == learned.fields.sectors * len(learned.fields.channels):
            shapes += _seen(learned.fields, features, rows + _CAPTION)
            height += _FIELD_ROWS
    for share, text in ((0.0, "behind"), (0.25, "left"), (0.5, "ahead"), (0.75, "right")):
        shapes.append(label(share * columns + 3, rows + 11, text, font_size=9))
        shapes.append(
            element(
                "line",
                x1=share * columns,
                y1=rows,
                x2=share * columns,
                y2=rows + 10,
                stroke=FAINT,
                stroke_width=0.6,
            )
        )
    return drawing(
        columns,
        height,
        *shapes,
        title="panorama with the receptive fields",
        viewBox=f"{-_MARGIN} 0 {columns + _MARGIN} {height:g}",
    )


def _aim(goal: Goal, bearing: float) -> str:
    """Mark the direction in which the goal is seen."""
    x = (pi - bearing) / (2 * pi) % 1.0 * _SIZE.columns
    return element(
        "path",
        tip(goal_seen(goal)),
        d=f"M {x - 6:.1f} 0 L {x + 6:.1f} 0 L {x:.1f} 12 Z",
        fill=BEST,
        data_kind="goal",
    )


def _profiles(fields: Fields) -> list[str]:
    shapes = []
    columns, rows = _SIZE.columns, _SIZE.rows
    for k in range(fields.sectors):
        centre = (k + 0.5) / fields.sectors
        curve = []
        for x in range(0, columns + 1, _CURVE_STEP):
            apart = 2 * pi * (x / columns - centre)
            if abs(apart) < 3 * fields.width:
                curve.append((x, rows * (1 - 0.8 * exp(-0.5 * (apart / fields.width) ** 2))))
        shapes.append(
            element(
                "polyline",
                points=points(curve),
                fill="none",
                stroke=BEST,
                stroke_width=0.8,
                opacity=0.8,
                data_kind="field",
            )
        )
    return shapes


def _seen(fields: Fields, features: list[float], top: float) -> list[str]:
    width, channels = _SIZE.columns / fields.sectors, len(fields.channels)
    height = _FIELD_ROWS / channels
    shapes = []
    for k, value in enumerate(features):
        sector, channel = divmod(k, channels)
        shapes.append(
            element(
                "rect",
                tip(f"{fields.channels[channel]} {value:.2f}"),
                x=sector * width,
                y=top + channel * height,
                width=width - 1,
                height=height - 1,
                fill=heat(value),
                data_kind="feature",
            )
        )
    for channel, name in enumerate(fields.channels):
        y = top + (channel + 0.72) * height
        short = "-".join(part[:1] for part in name.split("-"))
        shapes.append(label(-4, y, short, tip(name), font_size=9, text_anchor="end"))
    return shapes


def _is_picture(frame: bytes) -> bool:
    """Return whether a browser may be given a frame, which it decodes whatever its size."""
    try:
        check_picture(frame, _COMPLAINT)
    except CameraError:
        return False
    return True


def _mirror_of(eye: Eye | None) -> Mirror:
    return Mirror(**eye.model_dump()) if eye else Mirror()


def _unwrapped(frame: bytes, eye: Eye | None) -> bytes | None:
    try:
        flat: Image = _unwrapper(_mirror_of(eye))(decode_picture(frame, _COMPLAINT))
    except CameraError:
        return None  # damaged, or of another camera than the one described
    return bytes(cv2.imencode(".jpg", flat)[1].tobytes())


@lru_cache(4)
def _unwrapper(mirror: Mirror) -> Unwrapper:
    return Unwrapper(mirror, _SIZE)


def _picture(data: bytes, width: float, height: float) -> str:
    kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    return element("image", href=source, width=width, height=height, preserveAspectRatio="none")
