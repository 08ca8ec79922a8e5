"""A pseudo-terminal with nothing behind it: every line that comes is answered with the same bytes.

Run as a process of its own: prints the terminal's path. What the emulator's exchanges are held
against; the reply is the argument. A line that is a number is answered so many seconds later.
"""

import os
import select
import sys
import tty


def main() -> None:
    """Answer until the pipe that started this, or the terminal, is closed."""
    reply = sys.argv[1].encode() + b"\r\n"
    master, slave = os.openpty()
    tty.setraw(slave)
    sys.stdout.write(f"{os.ttyname(slave)}\n")
    sys.stdout.flush()
    while data := os.read(master, 4096):
        if data[:1].isdigit():
            select.select((), (), (), float(data))
        os.write(master, reply * data.count(b"\n"))


if __name__ == "__main__":
    main()
