"""Turrets: modules stacked on a robot, one file each, behind the interface in `turret`."""
