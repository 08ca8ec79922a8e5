"""The protocol interpreter of the ROM: a request line in, the bytes of its reply out.

No I/O: when a line arrives and when the reply leaves is the serial line's affair (`uart`). What
sources leave open is decided in `choices`.
"""

from collections.abc import Callable

from khepera_protocol.serial.errors import RequestError
from khepera_protocol.serial.messages import (
    COMMAND_NOT_FOUND,
    PROTOCOL_ERROR,
    TURRET_NOT_SUPPORTED,
    Reply,
    Request,
    ToolCall,
    encode_line,
    parse_request,
)
from khepera_protocol.serial.turrets import parse_message

from khepera_emulator.body.motors import Gains, Mode, Profile, Wheel
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.robot.khepera.tools import (
    LOADER_DONE,
    About,
    begins_loader,
    load_record,
    set_rate,
    tool_lines,
)

_OPEN_BUS = 255
"""Reading of an address that nothing answers on."""

_LED_OFF, _LED_ON = 0, 1


class Firmware:
    """Interpreter of one robot's serial protocol, without a state of its own.

    Args:
        robot: what it reads and drives.
        on_rate: told the rate in bits a second that the tool `serial` sets, to hold from after
            its reply.
        on_refusal: told each request that is refused, and why.
    """

    def __init__(
        self,
        robot: Robot,
        on_rate: Callable[[int], None] = lambda _: None,
        on_refusal: Callable[[bytes, RequestError], None] = lambda _, __: None,
    ) -> None:
        self._robot = robot
        self._on_rate = on_rate
        self._on_refusal = on_refusal
        self._choices = robot.equipment.choices
        self._strict = self._choices.reject_beyond
        self._lenient = not self._choices.count_arguments
        self._commands: dict[str, Callable[..., tuple[int, ...]]] = {
            "A": self._configure_speed,
            "C": self._set_position,
            "D": self._set_speed,
            "E": self._read_speeds,
            "F": self._configure_position,
            "G": self._set_counters,
            "H": self._read_counters,
            "I": self._read_analogue,
            "J": self._configure_profile,
            "K": self._motion_status,
            "L": self._change_led,
            "N": self._robot.proximity,
            "O": self._robot.ambient,
            "P": self._set_duty,
            "R": self._read_bus,
            "W": self._write_bus,
        }

    def banner(self) -> bytes:
        """Return what the robot says after power-on."""
        rom, choices = self._robot.model.rom, self._choices
        name, date = choices.rom_name or rom.name, choices.rom_date or rom.date
        revision = choices.rom_revision or rom.revision
        return encode_line(
            f"ROM of minirobot {name}, Edoardo Franzi K-Team S.A. {date} Rev. {revision}"
        ) + encode_line("Serial Communication Protocol")

    def execute(self, line: bytes) -> bytes:
        """Carry out one request line; every line gets an answer, but for the loader's records."""
        panel = self._robot.panel
        if panel.loading:
            said = load_record(line)
            if said is not None:
                panel.loading = said != LOADER_DONE
                return encode_line(said) if said else b""
            panel.loading = False  # as nothing but power-on could end it on the robot (a choice)
        try:
            request = parse_request(line, self._strict, self._lenient)
            if isinstance(request, ToolCall):
                return self._run_tool(request)
            return self._answer(request)
        except RequestError as error:
            self._on_refusal(line, error)
            return encode_line(self._refusal(error.reply))

    def _refusal(self, text: str) -> str:
        if text == COMMAND_NOT_FOUND and self._choices.error_prefix:
            return f"z,{text}"
        if text == PROTOCOL_ERROR and self._choices.error_dot:
            return f"{text}."
        return text

    def _answer(self, request: Request) -> bytes:
        letter, arguments, _ = request
        command = self._commands.get(letter)
        if command is not None:
            return Reply(letter.lower(), command(*arguments)).encode()
        if letter == "B":
            return Reply("b", text=self._versions()).encode()
        return self._pass_on(request).encode()

    def _versions(self) -> tuple[str, str]:
        bios, protocol = self._robot.model.versions
        return self._choices.bios or bios, self._choices.protocol or protocol

    def _pass_on(self, request: Request) -> Reply:
        """Pass a message on to a turret; an error if there is none that understands it."""
        (number,) = request.arguments
        turret = self._robot.turrets.find(number)
        if turret is None:
            raise RequestError(TURRET_NOT_SUPPORTED, f"no turret {number} is mounted")
        ignore_extra = not self._choices.count_arguments
        message, arguments = parse_message(turret.kind, request.rest, ignore_extra=ignore_extra)
        values = turret.answer(message.letter, arguments, self._robot.time)
        return Reply("t", (number,), (message.letter.lower(), *map(str, values)))

    def _configure_speed(self, *arguments: int) -> tuple[int, ...]:
        for wheel in self._robot.wheels:
            wheel.speed_gains = Gains(*arguments)
        return ()

    def _configure_position(self, *arguments: int) -> tuple[int, ...]:
        for wheel in self._robot.wheels:
            wheel.position_gains = Gains(*arguments)
        return ()

    def _configure_profile(self, *arguments: int) -> tuple[int, ...]:
        left, right = self._robot.wheels
        left.profile, right.profile = Profile(*arguments[:2]), Profile(*arguments[2:])
        return ()

    def _set_position(self, *arguments: int) -> tuple[int, ...]:
        for wheel, target in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_position(target)
        return ()

    def _set_speed(self, *arguments: int) -> tuple[int, ...]:
        for wheel, speed in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_speed(speed)
        return ()

    def _set_duty(self, *arguments: int) -> tuple[int, ...]:
        for wheel, duty in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_duty(duty)
        return ()

    def _set_counters(self, *arguments: int) -> tuple[int, ...]:
        for wheel, value in zip(self._robot.wheels, arguments, strict=True):
            if self._choices.counters_carry_target:
                wheel.target += value - wheel.counter
            wheel.counter = value
        return ()

    def _read_speeds(self) -> tuple[int, ...]:
        left, right = self._robot.wheels
        return left.measured, right.measured

    def _read_counters(self) -> tuple[int, ...]:
        left, right = self._robot.wheels
        return left.counter, right.counter

    def _motion_status(self) -> tuple[int, ...]:
        left, right = self._robot.wheels
        return (*self._wheel_status(left), *self._wheel_status(right))

    def _wheel_status(self, wheel: Wheel) -> tuple[int, int, int]:
        choices = self._choices
        reached, speed_mode = wheel.reached, wheel.mode is not Mode.POSITION
        if wheel.mode is Mode.SPEED:
            reached = choices.reached_at_rest and wheel.set_speed == 0
        elif speed_mode is False:
            speed_mode = choices.speed_mode_once_reached and reached
        return int(reached), int(speed_mode), wheel.error

    def _read_analogue(self, channel: int) -> tuple[int, ...]:
        counts = self._robot.turrets.analogue(channel)
        return (self._robot.analogue(channel) if counts is None else counts,)

    def _read_bus(self, address: int) -> tuple[int, ...]:
        byte = self._robot.turrets.read_bus(address)
        return (self._robot.panel.inputs.get(address, _OPEN_BUS) if byte is None else byte,)

    def _change_led(self, led: int, action: int) -> tuple[int, ...]:
        leds = self._robot.panel.leds
        leds[led] = not leds[led] if action > _LED_ON else action != _LED_OFF
        return ()

    def _write_bus(self, data: int, address: int) -> tuple[int, ...]:
        self._robot.panel.outputs[address] = data
        self._robot.turrets.write_bus(address, data)
        return ()

    def _run_tool(self, call: ToolCall) -> bytes:
        if call.word == "restart":
            self._robot.power_on()
            return self.banner()
        lines = tool_lines(call.word, call.arguments, self._about())
        if lines is None:
            raise RequestError(COMMAND_NOT_FOUND, f"no such tool: {call}")
        self._robot.panel.loading = begins_loader(call.word, call.arguments)
        rate = set_rate(call.word, call.arguments)
        if rate is not None:
            self._on_rate(rate)
        return b"".join(map(encode_line, lines))

    def _about(self) -> About:
        model = self._robot.model
        bios, protocol = self._versions()
        return About(bios, protocol, model.bauds, model.has_flash, self._robot.turrets.kinds)
