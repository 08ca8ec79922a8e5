"""Pictures from outside become arrays here, and nowhere else: bounded, whole, in colour, or named.

A picture is looked at before it is decoded: its header says how large it becomes, its end marker
that it is whole. OpenCV itself takes half a JPEG for a picture (from files in version 5, from
memory in 4.10), and scales, drops and repeats channels until there are three of them.

Accepted are JPEG, PNG and BMP with three channels of 8 bits. Other channels are refused rather
than converted: a grey picture has no colours to see by, and what is transparent is no view.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from macor_hil.arrays import Image
from macor_hil.errors import WrongPictureError

MAX_SIDE: Final = 4096
"""Pixels of the longest side that is decoded."""

MAX_BYTES: Final = 32 << 20
"""Bytes of the largest picture that is decoded."""

_MAX_PARTS: Final = 10_000
"""Chunks of a PNG, segments of a JPEG."""

_MAX_SCANS: Final = 32
"""Scans of a JPEG: encoders write a dozen at most, and each is a walk over the whole picture."""

_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JPEG: Final = b"\xff\xd8\xff"
_BMP: Final = b"BM"

_SIZES: Final = frozenset({0xC0, 0xC1, 0xC2})
"""Markers of JPEG headers: baseline, extended and progressive, Huffman-coded."""

_OTHER_SIZES: Final = frozenset(range(0xC3, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SCAN: Final = 0xDA
_END: Final = 0xD9
_ALONE: Final = frozenset({0x01, 0xD8})
"""Markers without a segment."""

_MARKER: Final = re.compile(rb"\xff([^\x00\xd0-\xd7\xff])", re.DOTALL)
"""The next marker: entropy-coded data holds 0xFF before a zero or a restart marker only."""

_CUT: Final = "it is cut short"
_COLOUR: Final = "; a picture needs three channels of 8 bits"


class _RefusedError(Exception):
    """A picture is not decoded; the message says why."""


def decode_picture(data: bytes, complaint: str) -> Image:
    """Decode a JPEG, PNG or BMP.

    Args:
        data: the file.
        complaint: beginning of the error, such as `cannot read the picture a.png`.

    Raises:
        WrongPictureError: it is damaged, cut short, too large, or has other channels than blue,
            green and red of 8 bits.
    """
    check_picture(data, complaint)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        image = None
    if image is None:
        raise WrongPictureError(f"{complaint} ({len(data):,} bytes): it is damaged")
    return as_image(image, complaint)


def check_picture(data: bytes, complaint: str) -> None:
    """Refuse what `decode_picture` would refuse by its header, its size or its end.

    Raises:
        WrongPictureError: see there.
    """
    try:
        if len(data) > MAX_BYTES:
            raise _RefusedError(f"{MAX_BYTES:,} bytes at most are read")
        width, height = _reader(data)(data)
        if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
            raise _RefusedError(
                f"it claims {width} x {height} pixels, {MAX_SIDE} x {MAX_SIDE} at most are read"
            )
    except _RefusedError as refused:
        raise WrongPictureError(f"{complaint} ({len(data):,} bytes): {refused}") from None


def read_picture(path: Path) -> Image:
    """Read a picture file.

    Raises:
        WrongPictureError: there is none, or none that `decode_picture` takes.
    """
    complaint = f"cannot read the picture {path}"
    try:
        if path.exists() and not path.is_file():  # opening a pipe would wait for its writer
            raise WrongPictureError(f"{complaint}: it is not a file")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise WrongPictureError(f"{complaint}: {error.strerror}") from None
    return decode_picture(data, complaint)


def as_image(picture: Any, complaint: str) -> Image:
    """Pass on a picture that OpenCV gives, if it is in colour and of 8 bits.

    Raises:
        WrongPictureError: it has other channels, or is too large.
    """
    image = np.asarray(picture)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise WrongPictureError(
            f"{complaint}: it has shape {image.shape} and type {image.dtype}{_COLOUR}"
        )
    height, width = image.shape[:2]
    if max(width, height) > MAX_SIDE:
        raise WrongPictureError(
            f"{complaint}: it has {width} x {height} pixels, {MAX_SIDE} x {MAX_SIDE} at most are"
            " taken"
        )
    return image


def _reader(data: bytes) -> Callable[[bytes], tuple[int, int]]:
    for start, read in ((_JPEG, _jpeg), (_PNG, _png), (_BMP, _bmp)):
        if data.startswith(start):
            return read
    raise _RefusedError("it is neither JPEG, PNG nor BMP" if data else "it is empty")


def _png(data: bytes) -> tuple[int, int]:
    """Return the width and height of a whole PNG."""
    if data[8:16] != b"\0\0\0\x0dIHDR" or len(data) < 33:
        raise _RefusedError(_CUT)
    depth, colour = data[24], data[25]
    if colour in (4, 6):
        raise _RefusedError(f"it has an alpha channel{_COLOUR}")
    if colour != 2:
        raise _RefusedError(f"it is grey, or has a palette{_COLOUR}")
    if depth != 8:
        raise _RefusedError(f"its channels have {depth} bits{_COLOUR}")
    at = len(_PNG)
    for _ in range(_MAX_PARTS):
        length, kind = int.from_bytes(data[at : at + 4]), data[at + 4 : at + 8]
        at += 12 + length
        if at > len(data):
            raise _RefusedError(_CUT)
        if kind == b"tRNS":
            raise _RefusedError(f"it has a transparent colour{_COLOUR}")
        if kind == b"IEND":
            return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    raise _RefusedError(f"it has more than {_MAX_PARTS:,} chunks")


def _jpeg(data: bytes) -> tuple[int, int]:
    """Return the width and height of a whole JPEG."""
    size, scans, at = None, 0, 2
    for _ in range(_MAX_PARTS):
        found = _MARKER.search(data, at)
        if found is None:
            raise _RefusedError(_CUT)
        marker, at = found.group(1)[0], found.end()
        if marker == _END and size and scans:
            return size
        if marker in _ALONE:
            continue
        length = int.from_bytes(data[at : at + 2])
        if marker == _END or length < 2:
            raise _RefusedError("it is damaged")
        if at + length > len(data):
            raise _RefusedError(_CUT)
        if marker in _SIZES:
            size = _jpeg_size(data[at + 2 : at + length])
        elif marker in _OTHER_SIZES:
            raise _RefusedError("it is a lossless or arithmetic-coded JPEG, which is not read")
        scans += marker == _SCAN
        if scans > _MAX_SCANS:
            raise _RefusedError(f"it has more than {_MAX_SCANS} scans")
        at += length
    raise _RefusedError(f"it has more than {_MAX_PARTS:,} segments")


def _jpeg_size(header: bytes) -> tuple[int, int]:
    if len(header) < 6:
        raise _RefusedError("it is damaged")
    depth, channels = header[0], header[5]
    if depth != 8:
        raise _RefusedError(f"its channels have {depth} bits{_COLOUR}")
    if channels != 3:
        raise _RefusedError(f"it has {channels} channels{_COLOUR}")
    return int.from_bytes(header[3:5]), int.from_bytes(header[1:3])


def _bmp(data: bytes) -> tuple[int, int]:
    """Return the width and height of a whole BMP without compression."""
    if len(data) < 54:
        raise _RefusedError(_CUT)
    start, header = (int.from_bytes(data[at : at + 4], "little") for at in (10, 14))
    width, height = (int.from_bytes(data[at : at + 4], "little", signed=True) for at in (18, 22))
    bits, compression = int.from_bytes(data[28:30], "little"), data[30:34]
    if header < 40 or compression != bytes(4) or bits != 24:
        raise _RefusedError(f"it is compressed, or has {bits} bits a pixel instead of 24{_COLOUR}")
    height = abs(height)  # negative: the top row comes first
    if width > 0 and start + height * ((3 * width + 3) & ~3) > len(data):
        raise _RefusedError(_CUT)
    return width, height
