"""The protocol interpreter of the ROM: a request line in, the bytes of its reply out.

No I/O: when a line arrives and when the reply leaves is the serial line's affair (`uart`).
"""

from collections.abc import Callable

from khepera_emulator.motors import Gains, Mode, Profile
from khepera_emulator.robot import Robot
from protocol.commands import TOOLS
from protocol.errors import RequestError
from protocol.messages import (
    COMMAND_NOT_FOUND,
    TURRET_NOT_SUPPORTED,
    Reply,
    Request,
    ToolCall,
    encode_line,
    parse_request,
)

_OPEN_BUS = 255
"""What an address reads that nothing answers on."""

_LED_OFF, _LED_ON = 0, 1


class Firmware:
    """Interpreter of one robot's serial protocol."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._commands: dict[str, Callable[[tuple[int, ...]], tuple[int, ...]]] = {
            "A": self._configure_speed,
            "C": self._set_position,
            "D": self._set_speed,
            "E": lambda _: tuple(wheel.measured for wheel in self._robot.wheels),
            "F": self._configure_position,
            "G": self._set_counters,
            "H": lambda _: tuple(wheel.counter for wheel in self._robot.wheels),
            "I": lambda arguments: (self._robot.panel.analogue[arguments[0]],),
            "J": self._configure_profile,
            "K": self._motion_status,
            "L": self._change_led,
            "N": lambda _: self._robot.proximity(),
            "O": lambda _: self._robot.ambient(),
            "P": self._set_duty,
            "R": lambda arguments: (self._robot.panel.inputs.get(arguments[0], _OPEN_BUS),),
            "W": self._write_bus,
        }

    def banner(self) -> bytes:
        """What the robot says after power-on."""
        return b"".join(encode_line(line) for line in self._robot.model.banner)

    def execute(self, line: bytes) -> bytes:
        """Carry out one request line; every line gets an answer."""
        try:
            request = parse_request(line)
        except RequestError as error:
            return encode_line(error.reply)
        if isinstance(request, ToolCall):
            return self._run_tool(request)
        return self._answer(request)

    def _answer(self, request: Request) -> bytes:
        letter = request.letter.lower()
        if request.letter == "B":
            return Reply(letter, text=self._robot.model.versions).encode()
        if request.letter == "T":
            return encode_line(TURRET_NOT_SUPPORTED)
        return Reply(letter, self._commands[request.letter](request.arguments)).encode()

    def _configure_speed(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel in self._robot.wheels:
            wheel.speed_gains = Gains(*arguments)
        return ()

    def _configure_position(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel in self._robot.wheels:
            wheel.position_gains = Gains(*arguments)
        return ()

    def _configure_profile(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        left, right = self._robot.wheels
        left.profile, right.profile = Profile(*arguments[:2]), Profile(*arguments[2:])
        return ()

    def _set_position(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel, target in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_position(target)
        return ()

    def _set_speed(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel, speed in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_speed(speed)
        return ()

    def _set_duty(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel, duty in zip(self._robot.wheels, arguments, strict=True):
            wheel.drive_duty(duty)
        return ()

    def _set_counters(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        for wheel, value in zip(self._robot.wheels, arguments, strict=True):
            wheel.counter = value
        return ()

    def _motion_status(self, _: tuple[int, ...]) -> tuple[int, ...]:
        status: list[int] = []
        for wheel in self._robot.wheels:
            status += [wheel.reached, wheel.mode is not Mode.POSITION, wheel.error]
        return tuple(map(int, status))

    def _change_led(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        led, action = arguments
        leds = self._robot.panel.leds
        leds[led] = not leds[led] if action > _LED_ON else action != _LED_OFF
        return ()

    def _write_bus(self, arguments: tuple[int, ...]) -> tuple[int, ...]:
        data, address = arguments
        self._robot.panel.outputs[address] = data
        return ()

    def _run_tool(self, call: ToolCall) -> bytes:
        if call.word == "restart":
            self._robot.power_on()
            return self.banner()
        return b"".join(encode_line(line) for line in self._tool_lines(call))

    def _tool_lines(self, call: ToolCall) -> list[str]:
        """Text of a tool; where the robot's own wording is unknown, plain words stand in."""
        bios, protocol = self._robot.model.versions
        match call.word:
            case "memory":
                return [
                    "First free ROM address:   16'00012490, used 57%",
                    "First free RAM 1 address: 16'001243F4, used 13%",
                    "First free RAM 2 address: 16'001A0000, used 0%",
                ]
            case "process":
                return [
                    "Process N. 00000000  IDLE process for the micro-kernell, EF-98: Rev. 1.00",
                    "Process N. 00000001  Start-up process of the Khepera, EF-98:    Rev. 5.00",
                ]
            case "help":
                return [f"{word}: {title}" for word, title in TOOLS.items()]
            case "list":
                return [f"BIOS Rev. {bios}", f"Serial communication protocol Rev. {protocol}"]
            case "ver":
                return [f"BIOS Rev. {bios}, protocol Rev. {protocol}"]
            case "net":
                return ["No turret on the extension bus"]
            case "serial":
                return ["Serial line: 8 data bits, no parity, 2 stop bits"]
            case "k-team":
                return ["K-Team S.A., Switzerland", "ROM: Edoardo Franzi"]
            case _:
                return [COMMAND_NOT_FOUND]
