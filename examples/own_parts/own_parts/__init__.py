"""Example parts for khepera-macor: a planner, a clusterer and eyes."""
