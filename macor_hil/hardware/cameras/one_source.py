"""One source of pictures: chosen once, kept while it answers, and never changed unheard.

On a network anybody may answer a question. Pictures that steer a robot come from a single source:
the one that alone answered when there was none. Who answers beside it is a stranger, and is not
taken even when the source has gone. A source that has gone (an emulator that was started again has
another identity) is followed by one that answers alone, and not before the change was told.
"""

import logging
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Final, Generic, TypeVar

from macor_hil.errors import CameraLostError, CameraSourceError

CENSUS: Final = 0.3
"""Seconds after the first answer for which others are waited for, where a source is chosen."""

SETTLING: Final = 1.0
"""Seconds for which a change of the source is an error. Whoever drives looks within them."""

_MOST: Final = 1000
"""Sources that are remembered."""

_A = TypeVar("_A")

_log = logging.getLogger(__name__)


class Round(Generic[_A]):
    """The first answer of each source to one question; filled by other threads.

    Attributes:
        answers: by source.
        refusals: reasons of those that answer with an error.
    """

    def __init__(self) -> None:
        self.answers: dict[str, _A] = {}
        self.refusals: dict[str, str] = {}
        self._strangers: set[str] | None = None
        self._new: SimpleQueue[str | None] = SimpleQueue()
        self._closed = False

    def add(self, source: str, answer: _A) -> None:
        """Take the answer of a source."""
        if source in self.answers or len(self.answers) >= _MOST:
            return
        self.answers[source] = answer
        if self._strangers is not None and len(self._strangers) < _MOST:
            self._strangers.add(source)
        self._new.put(source)

    def refuse(self, source: str, why: str) -> None:
        """Take the error that a source has answered with."""
        if len(self.refusals) < _MOST:
            self.refusals[source] = why
            self._new.put(source)

    def close(self) -> None:
        """Nobody answers any more."""
        self._new.put(None)

    def wait(self, seconds: float) -> bool:
        """Wait for another answer; False when none comes in time, or any more."""
        try:
            if not self._closed:
                self._closed = self._new.get(timeout=max(0.0, seconds)) is None
        except Empty:
            return False
        return not self._closed

    def call_strangers(self, strangers: set[str], source: str) -> None:
        """Take all others than the source, now and later, for strangers."""
        self._strangers = strangers
        strangers.update(other for other in tuple(self.answers) if other != source)


class OneSource(Generic[_A]):
    """Picks the answers of one source.

    Args:
        place: where it answers, for errors: `the Zenoh key khepera/khepera/camera`.
        clock: seconds.
    """

    def __init__(self, place: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.chosen: str | None = None
        self._place = place
        self._clock = clock
        self._strangers: set[str] = set()
        self._told = 0
        self._changed: float | None = None

    def pick(self, answers: Round[_A], seconds: float) -> _A | None:
        """Wait so long for the source's answer; None when it does not come.

        Raises:
            CameraSourceError: another one answers instead, or several where none is chosen yet.
            CameraLostError: it answers with an error.
        """
        end = self._clock() + seconds
        if self.chosen is None:
            if answers.wait(seconds):
                end = min(end, self._clock() + CENSUS)
            while answers.wait(end - self._clock()):
                pass
            return self._choose(answers)
        while self.chosen not in {*answers.answers, *answers.refusals}:
            if not answers.wait(end - self._clock()):
                return self._follow(answers)
        if self.chosen in answers.answers:
            self._changed = None
            return self._taken(answers)
        raise self._refused(answers.refusals[self.chosen])

    def _follow(self, answers: Round[_A]) -> _A | None:
        """Choose who comes after a source that has gone."""
        others = set(answers.answers) - self._strangers
        if not others:
            return None
        if self._changed is None:
            self._changed = self._clock()
        if self._clock() - self._changed >= SETTLING:
            return self._choose(answers)
        raise CameraSourceError(
            f"pictures on {self._place} come from another source than before ({_names(others)}"
            f" instead of {self.chosen}); it is taken if it answers alone for {SETTLING:g} s"
        )

    def _choose(self, answers: Round[_A]) -> _A | None:
        """Choose the only one that answers, who is the source from now on."""
        known = set(answers.answers) - self._strangers
        if len(known) > 1:
            raise CameraSourceError(
                f"{len(known)} sources answer on {self._place} ({_names(known)}), and nothing says"
                " which of them is the robot's camera; end the others"
            )
        if not known and answers.refusals:
            raise self._refused(next(iter(answers.refusals.values())))
        if not known:
            return None
        (self.chosen,) = known
        self._changed = None
        _log.info("pictures on %s come from %s", self._place, self.chosen)
        return self._taken(answers)

    def _refused(self, why: str) -> CameraLostError:
        return CameraLostError(f"the camera on {self._place} answers: {why}")

    def _taken(self, answers: Round[_A]) -> _A:
        assert self.chosen is not None
        answers.call_strangers(self._strangers, self.chosen)
        if len(self._strangers) > self._told:
            self._told = len(self._strangers)
            _log.warning(
                "%d other sources answer on %s, too; their pictures are not used",
                self._told,
                self._place,
            )
        return answers.answers[self.chosen]


def _names(sources: set[str]) -> str:
    return " and ".join(sorted(sources)[:3])
