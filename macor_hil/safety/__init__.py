"""What makes sure that the robot stands: signals, helper threads, watchdogs, claims."""
