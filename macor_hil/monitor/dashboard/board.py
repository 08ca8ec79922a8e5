"""A robot's page as named parts, each made anew only when what it shows has changed.

The name of a part says where it goes: `id` is the content of an element, `id@name` an attribute of
it, `id/key` one of its children, and three names (`eye`, `cells`, `player`) hold values that the
page's script draws.
A browser gets the parts that differ from what it has; see `connection`.
"""

from collections.abc import Callable, Mapping
from html import escape
from typing import Any, Final

from macor_hil.monitor.dashboard.drawings import arena, charts, eyes, texts
from macor_hil.monitor.dashboard.drawings.svg import element
from macor_hil.monitor.driving import driver_of, over
from macor_hil.monitor.robot_state import RobotState

Part = str | dict[str, Any] | None
Parts = dict[str, Part]

ROBOTS: Final = "roster"

_FRESH: Final = 2.0
"""Seconds for which readings of the line are taken before the decision's."""


class Board:
    """Parts of one robot's page; shared by all browsers that look at it.

    Attributes:
        picture: the latest picture that a browser may be given; empty: none yet.
    """

    def __init__(self) -> None:
        self.picture = b""
        self._made: dict[str, tuple[tuple[object, ...], Part]] = {}
        self._frame: bytes = b""

    def parts(self, watched: RobotState, others: Mapping[str, RobotState], now: float) -> Parts:
        """Return all parts as of now.

        Args:
            watched: the robot.
            others: all robots, this one too, by their names.
            now: the time that ages count to, in seconds of the clock of the arrivals.
        """
        if watched.frame is not self._frame:
            self._frame = watched.frame
            self.picture = watched.frame if eyes.is_picture(watched.frame) else self.picture
        return {
            **self._head(watched, others, now),
            **self._arena(watched, others),
            **self._camera(watched, now),
            **self._decision(watched),
            **self._robot(watched, now),
        }

    def _once(self, name: str, draw: Callable[..., Part], *inputs: Any) -> Part:
        """Return a part, made anew where an input is another one than last time."""
        known = self._made.get(name)
        if known is None or not _same(known[0], inputs):
            known = self._made[name] = inputs, draw(*inputs)
        return known[1]

    def _head(self, watched: RobotState, others: Mapping[str, RobotState], now: float) -> Parts:
        driver = driver_of(watched, now)
        parts: Parts = {
            "driver": escape(driver.words),
            "driver@data-mood": driver.mood,
            "reason": escape(driver.reason),
            "reason@data-mood": driver.mood,
            # told when it is another one, not with every command
            "news": escape(f"{watched.robot}: {driver.brief.partition(' ')[0]}"),
            "equipment": texts.equipment(watched),
            ROBOTS: self._once(ROBOTS, _buttons, tuple(others)),
            "robots@hidden": "" if len(others) < 2 else None,
        }
        for number, (name, other) in enumerate(others.items()):
            brief = driver if other is watched else driver_of(other, now)
            parts[f"brief-{number}"] = escape(brief.brief)
            parts[f"robot-{number}@data-mood"] = brief.mood
            parts[f"robot-{number}@aria-pressed"] = str(name == watched.robot).lower()
        return parts

    def _arena(self, watched: RobotState, others: Mapping[str, RobotState]) -> Parts:
        outline = watched.emulated.outline
        pieces = arena.way_pieces(watched)
        pose, radius = watched.pose, watched.radius
        ways = arena.hypothetical_ways(watched)
        if outline and outline.solids:
            window = arena.whole(outline, ())
        else:
            window = arena.whole(None, [(p.x, p.y) for piece in pieces.values() for p in piece])
        parts: Parts = {
            "arena@viewBox": window.box,
            "arena-title": arena.told(ways),
            "ground": self._once("ground", arena.ground, outline) if outline else "",
            "scale": self._once("scale", arena.scale, window),
            "marks": arena.marks(watched.marks),
            "near@viewBox": arena.close_up(pose, ways).box if pose else "0 0 360 360",
            "plans": arena.plans(ways, radius),
            "arena-card@data-empty": None if pose or outline else "no robot yet",
            "arena@data-things": str(outline.things) if outline else "0",
        }
        for number, piece in pieces.items():
            name = f"way/{number}"
            parts[name] = self._once(name, lambda each, _: arena.way_piece(each), piece, len(piece))
        for name, other in _same_world(watched, others).items():
            where = other.pose
            if where is None:
                continue
            look = _look(other, chosen=other is watched)
            named = len(others) > 1
            parts[f"bodies/{name}"] = arena.robot(name, where, other.radius, look, named=named)
        return parts

    def _camera(self, watched: RobotState, now: float) -> Parts:
        learned, decision = watched.controlled.learned, watched.controlled.decision
        fields = learned.fields if learned else None
        goal = decision.goal if decision and not over(watched) else None
        return {
            "eye": self._once("eye", eyes.geometry, learned),
            "borders@viewBox": self._once("borders@viewBox", eyes.view_box, learned),
            "borders": self._once("borders", eyes.borders, learned),
            "profiles": self._once("profiles", eyes.profiles, fields) if fields else "",
            "aim": self._once("aim", eyes.aim, goal),
            "features": self._once("features", eyes.features, decision, fields)
            if decision and fields
            else "",
            "channels": self._once("channels", eyes.channel_names, fields) if fields else "",
            "camera-card@data-empty": None if self.picture else "no picture yet",
            "camera-card@data-stale": "" if texts.stale(watched, now) else None,
        }

    def _decision(self, watched: RobotState) -> Parts:
        seen = watched.controlled
        decision, learned = seen.decision, seen.learned
        gone = "" if over(watched) else None
        none = None if decision else "no controller" if not seen.alive else "no decision yet"
        parts: Parts = {
            "decision-card@data-empty": none,
            "rewards-card@data-empty": none,
            "columns-card@data-empty": none or (None if learned else "no map"),
            "decision-card@data-gone": gone,
            "rewards-card@data-gone": gone,
            "columns-card@data-gone": gone,
        }
        if decision is None:
            return parts
        shown, marks = list(seen.history)[-charts.MOST_BARS :], tuple(watched.marks)
        parts |= {
            "situation": self._once("situation", texts.situation, decision),
            "alternatives": self._once("alternatives", charts.alternatives, decision),
            "totals": self._once("totals", texts.totals, decision),
            "rewards": self._once(
                "rewards",
                lambda *_: charts.reinforcement(shown, marks),
                *(decision, len(shown), len(marks)),
            ),
            "reward-top": f"{charts.top_reinforcement(shown):.2f}",
            "reward-first": str(shown[0].sequence),
            "reward-last": str(decision.sequence),
        }
        if learned:
            parts |= {
                "columns": self._once("columns", charts.columns, learned),
                "row-names": self._once("row-names", charts.row_names, learned),
                "columns@data-rows": str(len(learned.commands)),
                "cells": self._once("cells", charts.cells, decision, learned),
                "activity": self._once("activity", charts.activity, decision, learned),
            }
        return parts

    def _robot(self, watched: RobotState, now: float) -> Parts:
        line, decision = watched.emulated.line, watched.controlled.decision
        read = line.proximity
        if decision and (read is None or now - read.when > _FRESH):
            values: tuple[int, ...] | None = tuple(decision.infrared)
        else:
            values = read.values if read else None
        of_robot = texts.of_the_robot(watched)
        health = texts.health(watched, now)
        return {
            "infrared": self._once("infrared", charts.infrared, watched.form, values)
            if values
            else self._once("no infrared", charts.infrared, watched.form, None),
            "infrared@hidden": None if values else "",
            "robot-rows": texts.rows(of_robot),
            "health-rows": texts.rows(health),
            "exchanges": self._once(
                "exchanges", lambda each, _: texts.exchanges(each), line, line.version
            ),
            "robot-card@data-empty": None if values or of_robot else "nothing known yet",
            "robot-card@data-gone": None if watched.alive else "",
            "line-card@data-empty": None if line.rows else "nothing has passed",
            "line-card@data-gone": None if watched.emulated.alive else "",
        }


def _buttons(names: tuple[str, ...]) -> str:
    """Return a button for each robot."""
    return "".join(
        element(
            "li",
            element(
                "button",
                element("strong", escape(name)),
                " ",
                element("span", "", id=f"brief-{number}"),
                type="button",
                id=f"robot-{number}",
                data_robot=name,
            ),
        )
        for number, name in enumerate(names)
    )


def _same_world(watched: RobotState, others: Mapping[str, RobotState]) -> Mapping[str, RobotState]:
    """Return the robots of a robot's world, itself last: it is drawn on top."""
    outline = watched.emulated.outline
    world = outline.world if outline else ""
    found = {
        name: other
        for name, other in others.items()
        if other is not watched
        and world
        and other.alive
        and other.emulated.outline
        and other.emulated.outline.world == world
    }
    return {**found, watched.robot: watched}


def _look(watched: RobotState, *, chosen: bool) -> str:
    """Return the classes of a robot's drawing."""
    looks = {"chosen": chosen, "touching": _touching(watched), "absent": not watched.alive}
    return " ".join(word for word, holds in looks.items() if holds)


def _touching(watched: RobotState) -> bool:
    truth, decision = watched.emulated.truth, watched.controlled.decision
    return bool((truth and truth.contact) or (decision and decision.collided))


def _same(known: tuple[object, ...], inputs: tuple[object, ...]) -> bool:
    """Return whether inputs are the same: values by their worth, all else by who they are."""
    return len(known) == len(inputs) and all(
        a is b or (isinstance(a, int | str | float | tuple) and a == b)
        for a, b in zip(known, inputs, strict=True)
    )
