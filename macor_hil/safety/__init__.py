"""Means that make sure that the robot stands: signals, helper threads, watchdogs, claims."""
