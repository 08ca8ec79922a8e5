"""Views of a running controller: Zenoh subscribers and nothing else."""
