"""Foresight: hypothetical drives over the free floor that the robot sees.

Lengths are in heights of the camera above the floor, as `eyes.floor_profile` measures them. Poses
are (ahead, to the left, turned to the left) from where the robot stands now.
"""
