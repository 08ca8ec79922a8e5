"""A first program for a robot: straight on, and away from what is near (Braitenberg).

    python student.py rfc2217://127.0.0.1:4003

The robot stands when the program ends, however it ends.
"""

import sys

import serial

SLOW, FAST = 3, 8
NEAR = 300


def ask(port: serial.Serial, request: str) -> list[int]:
    """Send a request, and return the numbers of the reply."""
    port.write(f"{request}\n".encode("ascii"))
    reply = port.readline().decode("ascii").strip()
    return [int(number) for number in reply.split(",")[1:]]


def drive(port: serial.Serial) -> None:
    """Drive for ever."""
    while True:
        seen = ask(port, "N")
        left, right = max(seen[0:3]), max(seen[3:6])
        if max(left, right) < NEAR:
            ask(port, f"D,{FAST},{FAST}")
        elif left > right:
            ask(port, f"D,{SLOW},{-SLOW}")
        else:
            ask(port, f"D,{-SLOW},{SLOW}")


def main() -> None:
    """Drive the robot at the address that was given."""
    with serial.serial_for_url(sys.argv[1], baudrate=9600, timeout=2) as port:
        try:
            drive(port)
        except KeyboardInterrupt:
            pass
        finally:
            ask(port, "D,0,0")


if __name__ == "__main__":
    main()
