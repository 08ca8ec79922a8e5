"""An e-puck's line as others hear it: text, binary rows, and packets on WiFi.

Answers to a row have no mark of their own: their size follows from the row's commands, so that a
reply is known by the request before it.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from khepera_protocol.epuck.codes import (
    ALL_ACTUATORS,
    ALL_SENSORS,
    PICTURE_HEAD,
    SENSORS_SIZE,
    SOUND_BUFFER,
    unpack,
)
from khepera_protocol.epuck.framing import Command, RequestSplitter, Sign
from khepera_protocol.epuck.generations import GCTRONIC2, GENERATIONS, Generation
from khepera_protocol.epuck.letters import GREETING, Line, reply_numbers
from khepera_protocol.epuck.packets import LEDS, Actuators, AllSensors, Behaviour, PacketError
from khepera_protocol.epuck.wifi import (
    PICTURE,
    REQUEST_SIZE,
    SENSORS,
    WIFI,
    WifiReader,
    WifiRequest,
    WifiSplitter,
)
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import WireEntry

from macor_hil.hardware.robots.epuck.readings import Counting, proximity_of, volts_of
from macor_hil.hardware.robots.form import NOTHING, REPLY, REQUEST, Listener, Passed, Reading

_WAITING: Final = 64
_LONGEST: Final = 200
"""Characters of a line, and bytes of a row, that are shown."""

_MOST: Final = 8192
"""Bytes that are kept of what has not come to its end."""

_GIVEN_UP: Final = 2.0
"""Seconds after which a request is not answered any more."""

_CUT: Final = "…"
"""End of an entry of which the rest was too long to be told."""

_RECOUNT: Final = "PR"
"""Letters of requests that set the step counters."""

_SHORT: Final = 16
"""Bits of counters in binary, and of those of an e-puck in text."""

_RING: Final = 8
_OTHERS: Final = {8: "body", 9: "front"}
_WELCOME: Final = GREETING[:9]
_HELLO: Final = "(it has started)"


def listener(dialect: str) -> Listener:
    """Make what reads a line of a dialect; of an unknown one, an e-puck2's."""
    if dialect == WIFI:
        return WifiListener()
    known = {each.name: each for each in GENERATIONS}
    return SerialListener(known.get(dialect, GCTRONIC2))


def shown(data: bytes) -> str:
    """Return bytes as hexadecimal numbers, and how many there are of many."""
    if len(data) <= _LONGEST:
        return data.hex(" ").upper()
    return f"{data[: _LONGEST // 8].hex(' ').upper()} … {len(data)} bytes"


@dataclass(slots=True)
class _Asked:
    """A request that waits for its answer.

    Attributes:
        text: as it is shown.
        time: when it came.
        line: it, in text.
        row: it, in binary.
    """

    text: str
    time: float
    line: Line | None = None
    row: list[Command] = field(default_factory=list)

    def size(self, begun: bytes) -> int | None:
        """Return how many bytes answer a row; None: it is not known yet."""
        total = 0
        # the buffer of the microphones goes out ahead of all else
        for command in self.row:
            if command.code.name == "U" and command.code.answer:
                total += SOUND_BUFFER
        for command in self.row:
            if command.code.answer is not None:
                total += command.code.answer
                continue
            head = begun[total : total + PICTURE_HEAD]
            if len(head) < PICTURE_HEAD:
                return None
            mode, width, height = head
            total += PICTURE_HEAD + width * height * (2 if mode else 1)
        return total


class _ByteListener(ABC):
    """Reads entries of a line's log as the bytes that they are."""

    def take(self, entry: WireEntry) -> Iterator[Passed]:
        """Yield what has come to its end by an entry."""
        if entry.what not in (REQUEST, REPLY):
            yield Passed(entry.what, printable(entry.text), entry.time)
            return
        if entry.text.endswith(_CUT):
            self.lose()
            yield Passed(entry.what, "(more bytes than are told)", entry.time)
            return
        data = entry.text.encode("latin-1", "replace")
        if entry.what == REQUEST:
            yield from self._requests(data, entry.time)
        else:
            yield from self._replies(data, entry.time)

    @abstractmethod
    def lose(self) -> None:
        """Forget halves and open requests."""

    @abstractmethod
    def _requests(self, data: bytes, time: float) -> Iterator[Passed]:
        """Yield requests that have come to their end by some bytes."""

    @abstractmethod
    def _replies(self, data: bytes, time: float) -> Iterator[Passed]:
        """Yield replies that have come to their end by some bytes."""


class SerialListener(_ByteListener):
    """Reads the line of an e-puck with a firmware; see `form.Listener`.

    Args:
        generation: the firmware.
    """

    def __init__(self, generation: Generation) -> None:
        self._generation = generation
        self._counting = Counting()
        self._lamps: dict[str, bool] = {}
        self.lose()

    def lose(self) -> None:
        """Forget halves and open requests."""
        self._splitter = RequestSplitter(self._generation.codes, self._generation.longest)
        self._sent, self._said = bytearray(), bytearray()
        self._begun = b""
        self._row: list[Command] = []
        self._waiting: deque[_Asked] = deque(maxlen=_WAITING)
        self._latest: _Asked | None = None

    def _requests(self, data: bytes, time: float) -> Iterator[Passed]:
        sent = self._sent
        sent += data
        while sent and (size := self._splitter.end(sent, len(sent))):
            portion = bytes(sent[:size])
            del sent[:size]
            self._begun += portion
            got = self._splitter.take(portion)
            if isinstance(got, Command):
                self._row.append(got)
            elif isinstance(got, Line):
                yield self._text(got, time)
            elif got is Sign.ROW_END:
                yield self._binary(time)
            elif not self._begun.strip(b"\0\r\n"):
                self._begun = b""
        if max(len(sent), len(self._begun)) > _MOST:
            self.lose()

    def _text(self, line: Line, time: float) -> Passed:
        self._begun = b""
        text = printable(line.text, _LONGEST)
        letter = self._letter(line)
        if letter not in self._generation.silent:
            self._waiting.append(_Asked(text, time, line))
        drives = letter == "D"
        asks = not self._numbers(line) and letter not in "KRS"
        if letter in _RECOUNT:
            self._counting = Counting()
        told = Reading(
            wanted=self._pair(line) if drives else None,
            lamps=self._switched(line),
            recounted=letter in _RECOUNT,
        )
        return Passed(REQUEST, text, time, asks=asks, drives=drives, reading=told)

    def _binary(self, time: float) -> Passed:
        row, self._row = self._row, []
        begun, self._begun = self._begun.lstrip(b"\0"), b""
        asked = _Asked(shown(begun), time, row=row)
        if asks := asked.size(b"") != 0:
            self._waiting.append(asked)
        return Passed(
            REQUEST,
            asked.text,
            time,
            asks=asks,
            drives=any(_drives(command) for command in row),
            reading=self._set(row),
        )

    def _replies(self, data: bytes, time: float) -> Iterator[Passed]:
        said = self._said
        said += data
        while said:
            while len(self._waiting) > 1 and time - self._waiting[0].time > _GIVEN_UP:
                self._waiting.popleft()
            if (at := said.find(_WELCOME)) >= 0:
                del said[: at + len(_WELCOME)]
                self._waiting.clear()
                self._counting = Counting()
                yield Passed(REPLY, _HELLO, time, reading=Reading(recounted=True))
                continue
            head = self._waiting[0] if self._waiting else None
            if head is not None and head.row:
                size = head.size(bytes(said))
                if size is None or len(said) < size:
                    break
                answer = bytes(said[:size])
                del said[:size]
                self._waiting.popleft()
                told = self._told(head.row, answer)
                yield Passed(REPLY, shown(answer), time, answers=head.text, reading=told)
                continue
            end = said.find(b"\n")
            if end < 0:
                break
            line = bytes(said[:end]).strip(b"\r\n")
            del said[: end + 1]
            if line:
                yield self._line(line, time)
        if len(said) > _MOST:
            self.lose()

    def _line(self, line: bytes, time: float) -> Passed:
        """Return a line that the robot said: an answer, one more line of it, or another one."""
        text = printable(line, _LONGEST)
        asked = next(
            (each for each in self._waiting if each.line and self._answers(line, each.line)), None
        )
        if asked is None:
            latest = self._latest
            return Passed(REPLY, text, time, answers=latest.text if latest else "", more=True)
        while self._waiting.popleft() is not asked:
            pass  # those before it got no answer
        self._latest = asked
        assert asked.line is not None
        return Passed(REPLY, text, time, answers=asked.text, reading=self._read(asked.line, line))

    def _letter(self, line: Line) -> str:
        letter = line.letter
        return letter if letter in self._generation.small else letter.upper()

    def _answers(self, reply: bytes, line: Line) -> bool:
        letter = self._letter(line).lower().encode("latin-1", "replace")
        if letter == b"h":
            return True  # help begins with any line
        return reply.startswith(b"z,") or (reply[:1] == letter and reply[1:2] in (b",", b" ", b""))

    def _numbers(self, line: Line) -> list[int]:
        return line.numbers(line.letter.upper(), 2, self._generation.bits)

    def _pair(self, line: Line) -> tuple[int, ...] | None:
        """Return two numbers; a request that lacks one keeps that of the one before."""
        found = self._numbers(line)
        return tuple(found) if len(found) == 2 else None

    def _read(self, line: Line, reply: bytes) -> Reading:
        letter = self._letter(line)
        try:
            values = reply_numbers(letter, reply)
        except (ValueError, KeyError):
            return NOTHING
        match letter:
            case "N":
                return Reading(proximity=proximity_of(values))
            case "O":
                return Reading(ambient=values)
            case "Q":
                if self._generation.bits > _SHORT:
                    self._counting = Counting()
                return Reading(counters=self._counting.take(values))
            case "E":
                return Reading(speed=values)
            case "b":
                return Reading(battery=self._volts(values[0]))
        return NOTHING

    def _volts(self, raw: int) -> float | None:
        return volts_of(raw, second=self._generation is GCTRONIC2)

    def _told(self, row: Sequence[Command], answer: bytes) -> Reading:
        """Read the answers of a row, one behind the other."""
        found = NOTHING
        at = SOUND_BUFFER if any(c.code.name == "U" and c.code.answer for c in row) else 0
        for command in row:
            size = command.code.answer
            if size is None:
                break  # a picture tells nothing of the rest but its length
            part, at = answer[at : at + size], at + size
            match command.code.name:
                case "N":
                    found = found._replace(proximity=proximity_of(unpack(part)))
                case "O":
                    found = found._replace(ambient=unpack(part))
                case "Q":
                    found = found._replace(counters=self._counting.take(_signed(part)))
                case "E":
                    found = found._replace(speed=_signed(part))
                case "b":
                    found = found._replace(battery=self._volts(*unpack(part)))
            if command.code.byte == ALL_SENSORS:
                found = sensed(AllSensors.unpack(part), self._counting)
        return found

    def _set(self, row: Sequence[Command]) -> Reading:
        """Return what a row sets."""
        found = NOTHING
        for command in row:
            if command.code.name == "D":
                found = found._replace(wanted=_signed(command.parameters))
            elif command.code.name in _RECOUNT:
                found = found._replace(recounted=True)
            elif command.code.name == "L":
                lamps = self._lamp(command.parameters[0], command.parameters[1])
                found = found._replace(lamps=found.lamps + lamps)
            elif command.code.byte == ALL_ACTUATORS:
                told = actuated(Actuators.unpack(command.parameters))
                found = told._replace(recounted=told.recounted or found.recounted)
        if found.recounted:
            self._counting = Counting()
        return found

    def _switched(self, line: Line) -> tuple[tuple[str, bool], ...]:
        """Return what a request in text does to lamps."""
        letter, numbers = self._letter(line), self._numbers(line)
        if letter == "S":
            return self._lamp(-1, 0)
        if letter == "L" and len(numbers) == 2:
            return self._lamp(numbers[0] if 0 <= numbers[0] < _RING else -1, numbers[1])
        if letter in "BF" and numbers:
            return self._lamp(8 if letter == "B" else 9, numbers[0])
        return ()

    def _lamp(self, number: int, action: int) -> tuple[tuple[str, bool], ...]:
        """Return lamps and their new states; nobody knows that of an unknown one after a toggle."""
        if number in _OTHERS:
            names = [_OTHERS[number]]
        else:
            names = [str(each) for each in ([number] if 0 <= number < _RING else range(_RING))]
        for name in names:
            if action in (0, 1):
                self._lamps[name] = bool(action)
            elif name in self._lamps:
                self._lamps[name] = not self._lamps[name]
        return tuple((name, self._lamps[name]) for name in names if name in self._lamps)


class WifiListener(_ByteListener):
    """Reads the packets of an e-puck2 on WiFi; see `form.Listener`."""

    def __init__(self) -> None:
        self._counting = Counting()
        self.lose()

    def lose(self) -> None:
        """Forget halves and open requests."""
        self._splitter = WifiSplitter()
        self._reader = WifiReader()
        self._sent = bytearray()
        self._begun = b""
        self._waiting: deque[tuple[str, bool]] = deque(maxlen=_WAITING)
        self._latest = ""  # of which the sensors are still to come

    def _requests(self, data: bytes, time: float) -> Iterator[Passed]:
        sent = self._sent
        sent += data
        while sent and (size := self._splitter.end(sent, len(sent))):
            portion = bytes(sent[:size])
            del sent[:size]
            self._begun = (self._begun + portion)[-REQUEST_SIZE:]
            request = self._splitter.take(portion)
            if isinstance(request, WifiRequest):
                text, self._begun = shown(self._begun), b""
                both = request.pictures and request.sensors
                self._waiting.append((text, both))
                told = actuated(request.actuators)
                if told.recounted:
                    self._counting = Counting()
                yield Passed(
                    REQUEST, text, time, asks=True, drives=told.wanted is not None, reading=told
                )

    def _replies(self, data: bytes, time: float) -> Iterator[Passed]:
        try:
            packets = self._reader.feed(data)
        except PacketError:
            self._reader = WifiReader()
            return
        for head, body in packets:
            yield self._packet(head, body, time)

    def _packet(self, head: int, body: bytes, time: float) -> Passed:
        text = shown(bytes([head]) + body)
        # a picture comes ahead of the sensors that were asked for with it
        more = head == SENSORS and bool(self._latest)
        answers, both = self._latest, False
        if not more:
            answers, both = self._waiting.popleft() if self._waiting else ("", False)
        self._latest = answers if both and head == PICTURE else ""
        told = NOTHING
        if head == SENSORS:
            told = sensed(AllSensors.unpack(body[:SENSORS_SIZE]), self._counting)
        return Passed(REPLY, text, time, answers=answers, more=more, reading=told)


def sensed(sensors: AllSensors, counting: Counting) -> Reading:
    """Return what a packet of all sensors tells."""
    return Reading(
        proximity=proximity_of(sensors.proximity),
        ambient=sensors.ambient,
        counters=counting.take(sensors.steps),
        battery=volts_of(sensors.battery, second=True),
    )


def actuated(actuators: Actuators) -> Reading:
    """Return what a packet of all actuators sets."""
    steps = Behaviour.STEPS in actuators.behaviour
    lamps = tuple((_named(name), bool(actuators.leds >> k & 1)) for k, name in enumerate(LEDS))
    wanted = None if steps else actuators.wheels
    return Reading(wanted=wanted, lamps=lamps, recounted=steps)


def _named(led: str) -> str:
    """Return the name of a bit of the actuators: LED 1 is number 0 of the ring."""
    word, _, number = led.partition(" ")
    return str(int(number) - 1) if number else word


def _drives(command: Command) -> bool:
    return command.code.name == "D" or command.code.byte == ALL_ACTUATORS


def _signed(data: bytes) -> tuple[int, ...]:
    return unpack(data, signed=True)
