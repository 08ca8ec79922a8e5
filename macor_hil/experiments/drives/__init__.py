"""Drives that experiments share: training drives, systems, courses."""
