"""Arenas of a suite, for ports: bundled ones, and those that are generated, as files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from khepera_protocol.zenoh.payloads import Outline

from macor_hil.errors import MacorError
from macor_hil.files import write_atomically


@dataclass(frozen=True, slots=True)
class Place:
    """An arena of the suite.

    Attributes:
        arena: a bundled arena, or the seed of a generated one.
        own_colours: whether every wall has a colour of its own.
    """

    arena: str | int
    own_colours: bool = False

    @property
    def name(self) -> str:
        """Name in tables."""
        return self.arena if isinstance(self.arena, str) else f"generated-{self.arena}"

    @property
    def look(self) -> str:
        """Colours of its walls, in words."""
        return "own colours" if self.own_colours else "as it is"

    @property
    def shipped(self) -> bool:
        """True for a bundled arena as it comes."""
        return isinstance(self.arena, str) and not self.own_colours

    def file(self, folder: Path) -> str:
        """Return the arena for a port: its name, or the path of a file that is written now.

        Raises:
            EmulatorError: there is no such arena.
            MacorError: the folder cannot be written to.
        """
        if isinstance(self.arena, str) and self.shipped:
            return self.arena
        look = "-own-colours" if self.own_colours else ""
        return arena_file(folder, self.name + look, self._text)

    def _text(self) -> str:
        from khepera_emulator.arenas.arena import load_arena
        from khepera_emulator.arenas.arena_text import arena_text
        from khepera_emulator.routes.generator import generate
        from khepera_emulator.routes.variants import with_own_colours

        if isinstance(self.arena, int):
            return generate(self.arena, own_colours=self.own_colours).text
        return arena_text(with_own_colours(load_arena(self.arena)))


def arena_file(folder: Path, name: str, text: Callable[[], str]) -> str:
    """Return the path of an arena's file, which is written now if it is not there.

    Args:
        folder: place of all files of a sweep.
        name: of the arena, without spaces.
        text: gives the arena as TOML.

    Raises:
        MacorError: the folder cannot be written to.
    """
    path = folder / f"{name}.toml"
    if not path.exists():
        write_atomically(path, text().encode())
    return str(path)


def points_of(
    arena: str, outline: Outline, colour: tuple[float, float, float] | None
) -> list[tuple[float, float]]:
    """Return points in metres along the edges of all solids of a colour; None: an arena's lamps.

    Raises:
        EmulatorError: there is no such arena.
    """
    from khepera_emulator.arenas.arena import load_arena
    from khepera_emulator.routes.regions import edge_points

    if colour is None:
        return [lamp.centre for lamp in load_arena(arena).lamp]
    return edge_points(outline, colour)


def shipped(places: Iterable[Place]) -> tuple[str, ...]:
    """Return the arenas among places that come with the emulator, each once."""
    return tuple(dict.fromkeys(each.arena for each in places if isinstance(each.arena, str)))


def bundled_arenas() -> tuple[str, ...]:
    """Return the names of the arenas that come with the emulator."""
    from khepera_emulator.arenas.arena import arena_names

    return tuple(sorted(arena_names()))


def arena_for_port(arena: str) -> str:
    """Return an arena as ports and results name it: its name, or the whole path of its file.

    Raises:
        MacorError: there is no such arena, or a port could not name its file.
    """
    from khepera_emulator.arenas.arena import load_arena
    from khepera_emulator.errors import EmulatorError

    try:
        load_arena(arena)
    except EmulatorError as error:
        raise MacorError(str(error)) from None
    place = arena if arena in bundled_arenas() else str(Path(arena).resolve())
    if set(place) & set("%#?"):
        raise MacorError(f"the arena {place!r}: give it a path without %, # and ?")
    return place
