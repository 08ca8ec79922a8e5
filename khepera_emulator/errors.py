"""Errors of the emulator's set-up. Bytes on the line never raise: they are answered."""


class EmulatorError(Exception):
    """The emulator cannot do what it was told; the message says what, and what to try."""
