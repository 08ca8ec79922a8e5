"""Recordings of telemetry as MCAP files: written, read, played."""
