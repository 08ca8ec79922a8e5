"""The serial line to a robot: opened, read and written, with its statistics."""
