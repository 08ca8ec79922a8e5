"""The agreement between a Khepera and its host: bytes, messages, units and keys.

No clock, no thread and, but for opening a Zenoh session, no I/O: bytes go in, values come out. The
emulator and the controller both stand on this package and on nothing of each other.
"""


def __getattr__(name: str) -> str:
    """Return `__version__`, which is read from the installation when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from khepera_protocol.version import installed_version

    return installed_version()
