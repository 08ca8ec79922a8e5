"""Senses of a robot: infrared, and the camera over the mirror."""
