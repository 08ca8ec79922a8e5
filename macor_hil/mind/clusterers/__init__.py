"""Clusterers: which visual situation a frame shows."""
