"""The lock beside a link to an emulator's terminal: whoever made the link holds it while it lives.

It goes with the process, however that ends. The link itself may be left behind, and then leads
to whoever got the terminal's number next.
"""

from pathlib import Path


def lock_beside(link: Path) -> Path:
    """Path of the file that is locked (`flock`) while a link's emulator lives."""
    return link.with_name(f"{link.name}.lock")
