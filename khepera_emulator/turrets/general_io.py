"""The general I/O turret: eight digital inputs and outputs on the byte bus, three A/D inputs."""

from khepera_protocol.serial.turrets import ANALOGUE_CHANNELS, BUS_ADDRESS, TURRETS

PULLED_UP = 255
"""What unconnected digital inputs read (a choice)."""


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
        """Outputs off; what is connected to the inputs stays."""
        self.outputs = 0

    def step(self, now: float) -> None:
        """Nothing here takes time."""

    def read_bus(self, address: int) -> int | None:
        """The digital inputs, at the turret's address."""
        return self.inputs if address == BUS_ADDRESS else None

    def write_bus(self, address: int, data: int) -> None:
        """The digital outputs, at the turret's address."""
        if address == BUS_ADDRESS:
            self.outputs = data

    def analogue(self, channel: int) -> int | None:
        """Counts at an analogue input."""
        return self.volts.get(channel)
