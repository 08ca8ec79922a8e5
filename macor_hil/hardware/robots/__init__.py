"""Robots as the driver drives them, whatever kind they are."""
