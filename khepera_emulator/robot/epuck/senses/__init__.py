"""Senses of an e-puck: infrared, motion, distance, ground, camera."""
