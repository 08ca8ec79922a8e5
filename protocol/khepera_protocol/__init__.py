"""The agreement between a Khepera and its host: bytes, messages, units and keys.

No clock, no thread and, but for opening a Zenoh session, no I/O: bytes go in, values come out. The
emulator and the controller both stand on this package and on nothing of each other.
"""
