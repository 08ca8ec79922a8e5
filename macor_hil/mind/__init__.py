"""The controller's learning and planning; no port, camera, file or clock.

A `Brain` is composed of eyes, a clusterer and memories; a planner reads one of the memories.
Each of them is found by name (`catalogue`), here or in other distributions.
"""
