"""Planners: from the present moment and a memory to the next command."""
