"""The bundled kinds of faults, one class each; see `fault` for what they are asked for with."""

from typing import Final

from khepera_emulator.line.fault import Effect, Fault, Passing, Victim

OF_BYTES: Final = ("p", "n", "dir", "at", "for")
OF_REPLIES: Final = ("p", "n", "at", "for")


class Drop:
    """Loss of a byte; its time on the wire passes."""

    victim = Victim.BYTE
    keys = OF_BYTES
    once = False

    def bend(self, passing: Passing, share: float, fault: Fault) -> str:
        """Let it not come."""
        del share, fault
        passing.copies = 0
        return shown(passing.byte)


class Flip:
    """A byte with one wrong bit."""

    victim = Victim.BYTE
    keys = OF_BYTES
    once = False

    def bend(self, passing: Passing, share: float, fault: Fault) -> str:
        """Change one of its bits."""
        del fault
        before = shown(passing.byte)
        passing.byte ^= 1 << int(share * 8)
        return f"{before} becomes {shown(passing.byte)}"


class Duplicate:
    """A byte that comes twice."""

    victim = Victim.BYTE
    keys = OF_BYTES
    once = False

    def bend(self, passing: Passing, share: float, fault: Fault) -> str:
        """Let it come once more, unless it is lost."""
        del share, fault
        passing.copies += passing.copies > 0
        passing.late += passing.each
        return shown(passing.byte)


class Delay:
    """A byte that comes later, with all behind it."""

    victim = Victim.BYTE
    keys = (*OF_BYTES, "time")
    once = False

    def bend(self, passing: Passing, share: float, fault: Fault) -> str:
        """Let it come later."""
        del share
        passing.late += fault.time
        return f"{shown(passing.byte)} {fault.time:g} s late"


class Truncate:
    """A reply without its end."""

    victim = Victim.REPLY
    keys = OF_REPLIES
    once = False

    def change(self, reply: bytes, share: float, fault: Fault) -> tuple[bytes, str]:
        """Cut a reply at a random place."""
        del fault
        kept = int(share * len(reply))
        return reply[:kept], f"{reply[kept:]!r} lost"


class Stray:
    """Text ahead of a reply, or at a time."""

    victim = Victim.REPLY
    keys = (*OF_REPLIES, "text")
    once = True

    def change(self, reply: bytes, share: float, fault: Fault) -> tuple[bytes, str]:
        """Put the text ahead of a reply."""
        del share
        return fault.text + reply, repr(fault.text)


class Stall:
    """A line that stands still, and goes on."""

    victim = Victim.REQUEST
    keys = (*OF_REPLIES, "dir")
    once = True
    effect = Effect.STALL


class Cut:
    """A line that loses all bytes for a while."""

    victim = Victim.REQUEST
    keys = OF_REPLIES
    once = True
    effect = Effect.CUT


class Reset:
    """A robot that starts again in mid-command."""

    victim = Victim.REQUEST
    keys = ("p", "n", "at")
    once = True
    effect = Effect.RESET


def shown(byte: int) -> str:
    """Return a byte as it is told."""
    return repr(bytes((byte,)))
