"""What a Khepera and its host agree on: bytes, messages, units and keys.

No I/O, no clock and no thread: bytes go in, values come out. The emulator and the controller
both stand on this package and on nothing of each other.
"""
