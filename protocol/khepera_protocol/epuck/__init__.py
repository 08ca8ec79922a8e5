"""The agreement between an e-puck or e-puck2 and its host: requests, answers, packets, as values.

Bytes go in, values come out; no I/O. Facts are read in the firmware of both robots and in clients
of others; docs/epuck.md names what each firmware does.
"""
