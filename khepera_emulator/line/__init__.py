"""The serial line: codes of bytes, timing, faults, wire log."""
