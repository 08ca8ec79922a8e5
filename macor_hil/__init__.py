"""The MACOR controller: sees, learns situations and their transitions, plans by anticipation."""


def __getattr__(name: str) -> str:
    """Return `__version__`, which is read from the installation when it is asked for."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from khepera_protocol.version import installed_version

    return installed_version()
