"""Damaged copies of bytes, as disks, cables and editors make them."""

from hypothesis import strategies as st

KINDS = ["flip", "set", "cut", "insert", "swap", "blank", "full", "double"]


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """A copy that was cut off, or has bits flipped, parts swapped, doubled, blanked or put in."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, max(0, len(data) - 1)))
        match draw(st.sampled_from(KINDS)):
            case "flip" if data:
                data[place] ^= 1 << draw(st.integers(0, 7))
            case "set" if data:
                data[place] = draw(st.integers(0, 255))
            case "cut":
                del data[place:]
            case "insert":
                data[place:place] = draw(st.binary(min_size=1, max_size=40))
            case "swap":
                other = draw(st.integers(0, max(0, len(data) - 1)))
                length = draw(st.integers(1, 64))
                first, second = data[place : place + length], data[other : other + length]
                data[place : place + length], data[other : other + length] = second, first
            case "blank":
                data[place : place + draw(st.integers(1, 64))] = b""
            case "full":  # a length that is as great as can be
                length = draw(st.sampled_from([2, 4, 8]))
                data[place : place + length] = b"\xff" * length
            case "double":
                data[place:place] = data[place : place + draw(st.integers(1, 256))]
    return bytes(data)
