"""Arenas for tests, made in place."""

from khepera_emulator.arena import Arena


def arena(**parts) -> Arena:
    """An arena with given parts; without any, an endless floor."""
    return Arena.model_validate(
        {
            "version": 1,
            "title": "test",
            "start": {"x": 0, "y": 0},
            "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
            **parts,
        }
    )
