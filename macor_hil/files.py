"""Files: written in one step; those from outside read whole, within bounds, with one error.

Whoever reads a file that others may have written begins here and turns `InputError` into the error
of its own kind. Nothing is decompressed, converted or evaluated before its size is known.
"""

import os
import re
import secrets
import stat
import struct
import zipfile
import zlib
from collections.abc import Sequence
from io import BytesIO
from math import prod
from pathlib import Path
from typing import Any, BinaryIO, Final, TypeVar

import numpy as np
from khepera_protocol.system.opening import AT_ONCE, BYTES, UNSHARED
from khepera_protocol.text import printable
from khepera_protocol.validation import first_fault
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from pydantic_core import to_json

from macor_hil.errors import MacorError

T = TypeVar("T")

MIB: Final = 1 << 20

_MOST_MEMBERS: Final = 64
_ENCRYPTED: Final = 1
_COMPRESSIONS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)

_NPY: Final = b"\x93NUMPY\x01\x00"
_NPY_HEADER: Final = re.compile(
    rb"\{'descr': '([<>|][?bBiuUf]\d{1,8})', 'fortran_order': (True|False),"
    rb" 'shape': \(((?:\d{1,9}, ?)*(?:\d{1,9})?)\), \} *\n"
)
"""The header of an array as NumPy writes it; no other is read, and none is evaluated."""


class InputError(ValueError):
    """A file cannot be used; the message says why, without naming the file."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file to read from; a named pipe would be waited for, a device has no end.

    Raises:
        OSError: it cannot be opened.
        InputError: it is no regular file.
    """
    handle = os.open(path, os.O_RDONLY | AT_ONCE | UNSHARED | BYTES)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise InputError("it is not a regular file")
    return os.fdopen(handle, "rb")


def read_bounded(path: Path, most: int) -> bytes:
    """Read a regular file of at most so many bytes.

    Raises:
        FileNotFoundError: there is none.
        InputError: it is no regular file, is too long, or cannot be read.
    """
    try:
        with open_regular(path) as file:
            data = file.read(most + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise InputError(error.strerror or str(error)) from None
    if len(data) > most:
        raise InputError(f"it has more than {most:,} bytes")
    return data


def read_arrays(data: bytes, most: int) -> dict[str, NDArray[Any]]:
    """Read the arrays of a NumPy archive (.npz) by their names.

    Args:
        data: the archive.
        most: bytes that all arrays may have together.

    Raises:
        InputError: it is no archive, is damaged, or its arrays are too large or of other kinds
            than numbers, truth values and text.
    """
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            members = archive.infolist()
            _check_members(members, most)
            return {
                member.filename.removesuffix(".npy"): _array(_expanded(archive, member))
                for member in members
            }
    except InputError:
        raise
    except (
        *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError),
        *(RuntimeError, ValueError, OverflowError),  # what of the format Python does not read
    ) as error:
        raise InputError(printable(str(error), 200)) from None


def write_atomically(path: Path, data: bytes, failure: type[MacorError] = MacorError) -> None:
    """Replace a file by new contents, durably and in one step.

    Raises:
        MacorError: the folder cannot be written to; of the kind `failure`.
    """
    # named before it is there, so that nothing that is raised in between leaves it behind
    new = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with new.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            new.replace(path)
        except BaseException:
            new.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise failure(f"cannot write {path}: {error.strerror}") from None


def checked(adapter: TypeAdapter[T], data: Any) -> T:
    """Return the value that JSON-able data stands for: all of it is known, possible and finite.

    Raises:
        InputError: something is missing, unknown, of another type or not within its bounds.
    """
    text = to_json(data, inf_nan_mode="constants")
    try:
        return adapter.validate_json(text, strict=True, extra="forbid")
    except ValidationError as error:
        raise InputError(first_fault(error)) from None


def _check_members(members: Sequence[zipfile.ZipInfo], most: int) -> None:
    if len(members) > _MOST_MEMBERS or len({m.filename for m in members}) < len(members):
        raise InputError("it holds too many arrays, or two of one name")
    if any(m.flag_bits & _ENCRYPTED or m.compress_type not in _COMPRESSIONS for m in members):
        raise InputError("it is encrypted, or compressed in another way than NumPy does")
    if sum(m.file_size for m in members) > most:
        raise InputError(f"its arrays have more than {most:,} bytes")


def _expanded(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    with archive.open(member) as file:
        # read() without a number would expand all that is there, whatever the size that is stated
        return file.read(member.file_size)


def _array(data: bytes) -> NDArray[Any]:
    start = len(_NPY) + 2
    length = int.from_bytes(data[len(_NPY) : start], "little")
    header = _NPY_HEADER.fullmatch(data[start : start + length])
    if not data.startswith(_NPY) or header is None:
        raise InputError("an array does not begin as NumPy writes it")
    kind, column_order, sides = header.groups()
    try:
        dtype = np.dtype(kind.decode())
    except TypeError:
        raise InputError(f"an array has numbers of the unknown kind {kind.decode()}") from None
    shape = tuple(int(side) for side in sides.replace(b" ", b"").split(b",") if side)
    if prod(shape) * dtype.itemsize != len(data) - start - length:
        raise InputError("an array has another size than it states")
    flat = np.frombuffer(data, dtype, offset=start + length)
    # a copy: what was read can then be learned into
    return flat.reshape(shape, order="F" if column_order == b"True" else "C").copy()
