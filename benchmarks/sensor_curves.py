"""Emulated sensor curves over the recorded points: pictures and tables of docs/sensors.md."""

from collections.abc import Iterable
from dataclasses import replace
from math import pi, radians
from typing import Any

import numpy as np
from khepera_protocol.palette import SERIES, drawing_style
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page import DOCS, PICTURES, table, write_part
from recorded import FALL_OFF, KHEPERA2_WALL, KHEPERA_WALL, LAMP, Curve

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.models import KHEPERA, KHEPERA2, Model
from khepera_emulator.senses.infrared import Infrared
from khepera_emulator.world.floor_plan import FloorPlan

Array = NDArray[np.float64]

_SCANS = 200
"""Scans whose mean and standard deviation stand for one reading."""

_WALL_FACE = 1.0
"""The place of the wall, metres in front of the origin."""

_PAGE = DOCS / "sensors.md"


def main() -> None:
    """Draw every picture and write every table."""
    with drawing_style():
        _proximity_part("khepera", KHEPERA, KHEPERA_WALL)
        _proximity_part("khepera2", KHEPERA2, KHEPERA2_WALL)
        _fall_off_part()
        _lamp_part()


def readings(model: Model, gap: float, off: float = 0.0) -> Array:
    """Return each sensor's reading before a white wall, without noise, within its scale.

    Args:
        model: the robot.
        gap: metres between wall and body.
        off: degrees between the sensor's lobe and the wall's normal.
    """
    infrared = _ring(model, wall=[{"points": [[1.005, -5.0], [1.005, 5.0]]}])
    values = [
        infrared.response(sensor, infrared.gaps(*place)[sensor])
        for sensor, place in enumerate(_places(model, gap, off))
    ]
    return np.clip(values, 0.0, model.full_scale)


def noisy_readings(model: Model, gap: float) -> Array:
    """Return scans before a white wall as N gives them: shape (scans, 8)."""
    infrared = _ring(model, wall=[{"points": [[1.005, -5.0], [1.005, 5.0]]}])
    scans = [
        [infrared.proximity(*place)[sensor] for sensor, place in enumerate(_places(model, gap))]
        for _ in range(_SCANS)
    ]
    return np.array(scans, dtype=float)


def _places(model: Model, gap: float, off: float = 0.0) -> list[tuple[float, float, float]]:
    """Poses that turn each sensor's lobe in turn towards the wall."""
    x = _WALL_FACE - gap - model.radius
    return [(x, 0.0, radians(off) - direction) for direction in model.sensor_directions]


def _ring(model: Model, **parts: Any) -> Infrared:
    arena = Arena.model_validate(
        {
            "version": 1,
            "title": "nothing else",
            "start": {"x": 0.0, "y": 0.0},
            "free": {"points": [[0.0, 0.0], [0.1, 0.0]], "half_width": 0.1},
            **parts,
        }
    )
    return Infrared(model, FloorPlan(arena), arena.lamp, np.random.default_rng(0))


def _proximity_part(name: str, model: Model, recorded: Curve) -> None:
    _draw_proximity(name, model, recorded)
    gaps = list(recorded)
    real = np.array([recorded[gap] for gap in gaps], dtype=float)
    plain = np.array([readings(model, gap / 1000) for gap in gaps])
    scans = np.array([noisy_readings(model, gap / 1000) for gap in gaps])
    by_gap = table(
        ["gap in mm", "recorded, mean of 8", "emulated", "error", "worst sensor", "noise, sd"],
        [
            [
                str(gap),
                f"{r.mean():.0f}",
                f"{e.mean():.0f}",
                _signed(e.mean() - r.mean()),
                _signed(_worst(e - r)),
                f"{s.std(axis=0).mean():.0f}",
            ]
            for gap, r, e, s in zip(gaps, real, plain, scans, strict=True)
        ],
    )
    write_part(_PAGE, f"{name}-gaps", by_gap)
    write_part(_PAGE, f"{name}-errors", _sensor_errors(plain - real, scans.mean(axis=1) - real))


def _sensor_errors(plain: Array, noisy: Array) -> str:
    """Errors of each sensor and of their mean, over all gaps; both of shape (gaps, 8)."""
    head = ["error in counts", *(f"s{sensor}" for sensor in range(8)), "mean of 8"]
    rows = []
    for title, errors in (("curve", plain), (f"mean of {_SCANS} scans", noisy)):
        columns = [*errors.T, errors.mean(axis=1)]
        rows.append(
            [f"{title}: mean absolute", *(f"{np.abs(column).mean():.0f}" for column in columns)]
        )
        rows.append([f"{title}: worst", *(_signed(_worst(column)) for column in columns)])
    return table(head, rows)


def _worst(errors: Array) -> float:
    return float(errors[np.abs(errors).argmax()])


def _signed(error: float) -> str:
    counts = round(float(error))
    return f"{counts:+d}" if counts else "0"


def _draw_proximity(name: str, model: Model, recorded: Curve) -> None:
    gaps = list(recorded)
    fine = np.linspace(0.7 * gaps[0], 1.15 * gaps[-1], 240)
    curves = np.array([readings(model, gap / 1000) for gap in fine])
    points = np.array([recorded[gap] for gap in gaps])
    figure = Figure(figsize=(10.0, 8.0), layout="constrained")
    axes = figure.subplots(3, 3, sharex=True, sharey=True)
    for number, panel in enumerate(axes.flat):
        curve, point = (
            (curves[:, number], points[:, number])
            if number < 8
            else (curves.mean(axis=1), points.mean(axis=1))
        )
        panel.plot(fine, curve, color=SERIES[0], label="emulated")
        panel.plot(gaps, point, "o", color=SERIES[1], markersize=6, label="recorded")
        panel.set_title(f"sensor {number}" if number < 8 else "mean of all")
        panel.grid()
    axes[0, 0].legend()
    for panel in axes[:, 0]:
        panel.set_ylabel("counts")
    for panel in axes[-1]:
        panel.set_xlabel("gap to a white wall, mm")
    figure.suptitle(model.title)
    figure.savefig(PICTURES / f"sensors-{name}.png")


def _fall_off(gap: int, angles: Iterable[float]) -> list[float]:
    """Mean reading of a first Khepera's sensors, their lobes turned to either side."""
    return [
        float(np.mean([readings(KHEPERA, gap / 1000, sign * off) for sign in (-1, 1)]))
        for off in angles
    ]


def _fall_off_part() -> None:
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    rows = []
    fine = np.linspace(0.0, 70.0, 141)
    for (gap, recorded), colour in zip(FALL_OFF.items(), SERIES, strict=False):
        axes.plot(fine, _fall_off(gap, fine), color=colour, label=f"emulated, {gap} mm")
        axes.plot(
            list(recorded), list(recorded.values()), "o", color=colour, label=f"recorded, {gap} mm"
        )
        emulated = _fall_off(gap, recorded)
        errors = np.array(emulated) - np.array(list(recorded.values()))
        rows += [
            [str(gap), str(angle), str(counts), f"{value:.0f}", _signed(value - counts)]
            for (angle, counts), value in zip(recorded.items(), emulated, strict=True)
        ]
        rows.append([str(gap), "all", "", "mean absolute", f"{np.abs(errors).mean():.0f}"])
        rows.append([str(gap), "all", "", "worst", _signed(_worst(errors))])
    axes.set(xlabel="angle between lobe and the wall's normal, degrees", ylabel="counts")
    axes.set_ylim(bottom=0.0)
    axes.grid()
    axes.legend()
    figure.savefig(PICTURES / "sensors-angle.png")
    head = ["gap in mm", "angle in degrees", "recorded", "emulated", "error"]
    write_part(_PAGE, "angle", table(head, rows))


def _lamp_reading(distance: float, angle: float = 0.0) -> float:
    """Mean of scans of a sensor with a 50 W lamp at a distance in metres, degrees off its axis."""
    # all sensors at one place, looking one way
    model = replace(KHEPERA2, sensor_directions=(0.0,) * 8, sensor_bearings=(0.0,) * 8)
    eye = np.array([model.radius, 0.0])
    away = distance * np.array([np.cos(angle * pi / 180), np.sin(angle * pi / 180)])
    infrared = _ring(model, lamp=[{"centre": (eye + away).tolist()}])
    return float(np.mean([infrared.ambient(0.0, 0.0, 0.0) for _ in range(_SCANS // 4)]))


def _lamp_part() -> None:
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    fine = np.linspace(20.0, 1100.0, 109)
    left.plot(fine, [_lamp_reading(d / 1000) for d in fine], label="emulated")
    left.plot(list(LAMP), list(LAMP.values()), "o", label="recorded")
    left.set(xlabel="distance of a 50 W lamp, mm", ylabel="counts (less is brighter)")
    angles = np.linspace(-100.0, 100.0, 81)
    for distance in (100, 200, 400):
        curve = [_lamp_reading(distance / 1000, angle) for angle in angles]
        right.plot(angles, curve, label=f"emulated, {distance} mm")
    right.set(xlabel="angle off the sensor's axis, degrees")
    for panel in (left, right):
        panel.grid()
        panel.legend()
    figure.savefig(PICTURES / "sensors-lamp.png")
    _write_lamp_table()


def _write_lamp_table() -> None:
    emulated = [_lamp_reading(distance / 1000) for distance in LAMP]
    errors = np.array(emulated) - np.array(list(LAMP.values()))
    rows = [
        [str(distance), str(counts), f"{value:.0f}", _signed(value - counts)]
        for (distance, counts), value in zip(LAMP.items(), emulated, strict=True)
    ]
    rows.append(["all", "", "mean absolute", f"{np.abs(errors).mean():.0f}"])
    rows.append(["all", "", "worst", _signed(_worst(errors))])
    write_part(_PAGE, "lamp", table(["distance in mm", "recorded", "emulated", "error"], rows))


if __name__ == "__main__":
    main()
