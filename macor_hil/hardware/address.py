"""The address of a serial port, parsed once: which kind of port it is, and what that can do."""

from dataclasses import dataclass
from typing import Final

from khepera_protocol.epuck.units import WIFI_PORT

DEFAULT_SEED: Final = 5
"""Robot and training that are shown; the README says over how many seeds the result holds."""

DEFAULT_PORT: Final = f"khepera://corridor?seed={DEFAULT_SEED}"


@dataclass(frozen=True, slots=True)
class PortAddress:
    """A device such as /dev/ttyUSB0, or a pySerial URL such as `khepera://corridor?seed=1`.

    Attributes:
        text: the address as it was given.
        scheme: of the URL; empty for a device.
    """

    text: str
    scheme: str

    @classmethod
    def parse(cls, text: str) -> "PortAddress":
        """Parse an address; every text is one, and the port tells whether it is there."""
        scheme, found, _ = text.partition("://")
        return cls(text, scheme if found else "")

    def __str__(self) -> str:
        return self.text

    @property
    def embedded(self) -> bool:
        """True for a robot in this process.

        It lives in virtual time, has a camera and a bench of its own, and is gone with its port.
        """
        return self.scheme == "khepera"

    @property
    def on_wifi(self) -> bool:
        """True for an e-puck2 on WiFi, which speaks packets: `epuck2://HOST` or with a port."""
        return self.scheme == "epuck2"

    @property
    def url(self) -> str:
        """The device or URL that pySerial opens."""
        if not self.on_wifi:
            return self.text
        host = self.text.partition("://")[2].rstrip("/")
        port = "" if host.rpartition(":")[2].isdigit() else f":{WIFI_PORT}"
        return f"socket://{host}{port}"

    @property
    def limits_writes(self) -> bool:
        """True where the port keeps a limit of its own for writing."""
        return self.scheme == "rfc2217"

    @property
    def is_device(self) -> bool:
        """True for a device of the system, which can be opened for exclusive use."""
        return not self.scheme
