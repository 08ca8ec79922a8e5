"""Memories: what commands led to, in the form that a planner reads."""
