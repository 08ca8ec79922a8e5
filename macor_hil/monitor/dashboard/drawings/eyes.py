"""The robot's view: what is drawn over mirror image and panorama, and what its fields see.

The pictures themselves go to the browser as they came; it unwraps the mirror image by the geometry
that stands here.
"""

from math import cos, exp, pi, sin
from typing import Any, Final

from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import Decision, Eye, Fields, Goal, Learned

from macor_hil.errors import CameraError
from macor_hil.hardware.cameras.decoding import check_picture
from macor_hil.monitor.dashboard.drawings.svg import clean, element, tip
from macor_hil.monitor.goals import goal_seen

COLUMNS: Final = 360
ROWS: Final = 80
_FIELD_ROW: Final = 14
_CURVE_STEP: Final = 6

_COMPLAINT: Final = "a frame is no picture"


def is_picture(frame: bytes) -> bool:
    """Return whether a browser may be given a frame, which it decodes whatever its size."""
    try:
        check_picture(frame, _COMPLAINT)
    except CameraError:
        return False
    return True


def geometry(learned: Learned | None) -> dict[str, Any]:
    """Return the mirror's place in a picture, in pixels, and the size of the panorama."""
    eye = _mirror_of(learned.eye if learned else None)
    return {
        "width": eye.width,
        "height": eye.height,
        "x": eye.centre_x,
        "y": eye.centre_y,
        "inner": eye.inner,
        "outer": eye.outer,
        "columns": COLUMNS,
        "rows": ROWS,
    }


def view_box(learned: Learned | None) -> str:
    """Return the `viewBox` over a mirror image."""
    eye = _mirror_of(learned.eye if learned else None)
    return f"0 0 {eye.width} {eye.height}"


def borders(learned: Learned | None) -> str:
    """Draw the rims of the mirror, and the borders of the receptive fields."""
    eye = _mirror_of(learned.eye if learned else None)
    rims = [
        element("circle", cx=eye.centre_x, cy=eye.centre_y, r=r) for r in (eye.inner, eye.outer)
    ]
    sectors = learned.fields.sectors if learned else 0
    lines = []
    for k in range(sectors):
        # borders lie half a field beside the centres
        azimuth = pi - 2 * pi * k / sectors
        (ax, ay), (bx, by) = (
            (eye.centre_x - r * sin(azimuth), eye.centre_y - r * cos(azimuth))
            for r in (eye.inner, eye.outer)
        )
        lines.append(element("path", d=f"M{ax:.1f} {ay:.1f}L{bx:.1f} {by:.1f}"))
    return "".join(rims + lines)


def profiles(fields: Fields) -> str:
    """Draw the profiles of the receptive fields over the panorama."""
    shapes = []
    for k in range(fields.sectors):
        centre = (k + 0.5) / fields.sectors
        curve = []
        for x in range(0, COLUMNS + 1, _CURVE_STEP):
            apart = 2 * pi * (x / COLUMNS - centre)
            if abs(apart) < 3 * fields.width:
                curve.append((x, ROWS * (1 - 0.8 * exp(-0.5 * (apart / fields.width) ** 2))))
        path = " ".join(f"{x},{y:.0f}" for x, y in curve)
        shapes.append(element("polyline", points=path, data_kind="field"))
    return "".join(shapes)


def aim(goal: Goal | None) -> str:
    """Mark the direction in which a goal is seen."""
    if goal is None or goal.bearing is None:
        return ""
    x = (pi - goal.bearing) / (2 * pi) % 1.0 * COLUMNS
    shape = f"M{x - 6:.0f} 0L{x + 6:.0f} 0L{x:.0f} 12Z"
    return element("path", tip(goal_seen(goal)), d=shape, data_kind="goal")


def features(decision: Decision, fields: Fields) -> str:
    """Draw what the receptive fields saw: a row for each channel, the lighter, the more."""
    seen, channels = decision.features, len(fields.channels)
    if not seen or len(seen) != fields.sectors * channels:
        return ""
    width = COLUMNS / fields.sectors
    shapes = []
    for k, value in enumerate(seen):
        sector, channel = divmod(k, channels)
        level = round(10 * min(max(value, 0.0), 1.0))
        shapes.append(
            element(
                "rect",
                tip(f"{fields.channels[channel]} {value:.2f}"),
                x=round(sector * width, 1),
                y=channel * _FIELD_ROW,
                width=round(width - 1, 1),
                height=_FIELD_ROW - 1,
                class_=f"h{level:x}",
                data_kind="feature",
            )
        )
    return "".join(shapes)


def channel_names(fields: Fields) -> str:
    """Return short names of the channels, a line each, the whole name as a hint."""
    return "".join(
        element("abbr", clean("-".join(part[:1] for part in name.split("-"))), title=name)
        for name in fields.channels
    )


def _mirror_of(eye: Eye | None) -> Mirror:
    return Mirror(**eye.model_dump()) if eye else Mirror()
