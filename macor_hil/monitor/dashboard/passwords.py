"""Passwords as hashes that may stand in a configuration file: scrypt, with a salt of their own."""

import base64
import binascii
import hashlib
import hmac
import secrets
from typing import Final

_N: Final = 2**15
_R: Final = 8
_P: Final = 1
_MEMORY: Final = 128 * 1024 * 1024
"""Bytes that scrypt may take; 32 MB are needed."""

_SALT: Final = 16
_LENGTH: Final = 32
_SCHEME: Final = "scrypt"

_LONGEST: Final = 1_000
"""Characters of a password that are looked at."""


def hash_password(password: str) -> str:
    """Return a hash for the configuration; another one every time."""
    salt = secrets.token_bytes(_SALT)
    parts = _text(salt), _text(_digest(password, salt))
    return ":".join([_SCHEME, str(_N), str(_R), str(_P), *parts])


def is_hash(text: str) -> bool:
    """Return whether a text is a hash that `hash_password` made."""
    return _parts(text) is not None


def is_password(password: str, hashed: str) -> bool:
    """Return whether a password is the one of a hash."""
    parts = _parts(hashed)
    if parts is None:
        return False
    salt, digest = parts
    return hmac.compare_digest(_digest(password, salt), digest)


def _digest(password: str, salt: bytes) -> bytes:
    text = password[:_LONGEST].encode(errors="replace")
    return hashlib.scrypt(text, salt=salt, n=_N, r=_R, p=_P, maxmem=_MEMORY, dklen=_LENGTH)


def _parts(hashed: str) -> tuple[bytes, bytes] | None:
    """Return salt and digest of a hash; None where it is none of these parameters."""
    fields = hashed.strip().split(":")
    if fields[:-2] != [_SCHEME, str(_N), str(_R), str(_P)]:
        return None
    try:
        salt, digest = (base64.urlsafe_b64decode(each) for each in fields[-2:])
    except (ValueError, binascii.Error):
        return None
    return (salt, digest) if (len(salt), len(digest)) == (_SALT, _LENGTH) else None


def _text(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode()
