"""The lock beside a link to an emulator's terminal: whoever made the link holds it while it lives.

It goes with the process, however that ends. The link itself may be left behind, and then leads
to whoever got the terminal's number next. A link without such a file beside it was made by
somebody else.
"""

from pathlib import Path
from typing import Final

LOCK_TEXT: Final = b"khepera-emulator holds this file while it lives\n"
"""Content of every lock: a file with another one is somebody's own."""


def lock_beside(link: Path) -> Path:
    """Return the path of the file that is locked (`flock`) while a link's emulator lives."""
    return link.with_name(f".{link.name}.khepera-emulator-lock")
