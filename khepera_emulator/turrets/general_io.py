"""The general I/O turret: eight digital inputs and outputs on the byte bus, three A/D inputs."""

from khepera_protocol.serial.turrets import ANALOGUE_CHANNELS, BUS_ADDRESS, TURRETS

PULLED_UP = 255
"""Reading of unconnected digital inputs (a choice)."""


class GeneralIO:
    """The general I/O turret of one robot; a bench sets its inputs and looks at its outputs.

    Attributes:
        inputs: byte at the digital inputs.
        outputs: byte at the digital outputs, 0 after power-on.
        volts: at the analogue inputs, in counts of the converter, by A/D channel.
    """

    kind = TURRETS["general-io"]

    def __init__(self) -> None:
        self.inputs = PULLED_UP
        self.outputs = 0
        self.volts = dict.fromkeys(ANALOGUE_CHANNELS, 0)

    def power_on(self) -> None:
        """Switch the outputs off; what is connected to the inputs stays."""
        self.outputs = 0

    def step(self, now: float) -> None:
        """Let time pass: nothing here takes any."""

    def read_bus(self, address: int) -> int | None:
        """Return the digital inputs, at the turret's address."""
        return self.inputs if address == BUS_ADDRESS else None

    def write_bus(self, address: int, data: int) -> None:
        """Set the digital outputs, at the turret's address."""
        if address == BUS_ADDRESS:
            self.outputs = data

    def analogue(self, channel: int) -> int | None:
        """Return counts at an analogue input."""
        return self.volts.get(channel)
