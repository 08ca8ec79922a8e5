"""A robot alone among solids as plain numbers, and compiled functions that step it."""
