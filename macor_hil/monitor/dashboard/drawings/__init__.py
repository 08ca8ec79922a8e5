"""Drawings and texts of the page, each a function of what is known of a robot."""
