"""Checks of what came over Zenoh that need no look into its payload."""

from typing import Final

import zenoh

from khepera_protocol.text import printable
from khepera_protocol.zenoh.payload_model import MOST_STAMP, PayloadError
from khepera_protocol.zenoh.payloads import Stamp

LONGEST_ENCODING: Final = 200
"""Bytes of the name of an encoding."""


def size_of(sample: zenoh.Sample) -> int:
    """Return the bytes that a sample holds in memory."""
    attachment = sample.attachment
    return len(sample.payload) + (0 if attachment is None else len(attachment))


def check_sample(sample: zenoh.Sample, key: str, limit: int) -> None:
    """Check that a sample came on a key, and within bounds.

    Args:
        sample: of anyone's making.
        key: spelt out. A subscriber of it also gets what is put on `**`.
        limit: greatest number of bytes.

    Raises:
        PayloadError: it is for many keys, too long, or of an odd encoding.
    """
    if str(sample.key_expr) != key:
        raise PayloadError(f"it came for {printable(str(sample.key_expr), 60)}, not for one key")
    if len(sample.payload) > limit:
        raise PayloadError(f"it has {len(sample.payload):,} bytes, {limit:,} at most are read")
    if len(str(sample.encoding).encode()) > LONGEST_ENCODING:
        raise PayloadError("its encoding has no end")


def stamp_of(sample: zenoh.Sample) -> Stamp | None:
    """Return the number and time of a sample; None where it has none.

    Raises:
        PayloadError: its attachment is no stamp.
    """
    if sample.attachment is None:
        return None
    try:
        if len(sample.attachment) > MOST_STAMP:
            raise PayloadError(f"it has {len(sample.attachment):,} bytes")
        return Stamp.parse(sample.attachment.to_bytes())
    except PayloadError as error:
        raise PayloadError(f"its stamp cannot be read: {error}") from None
