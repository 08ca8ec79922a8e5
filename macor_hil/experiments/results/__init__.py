"""Results on disk, each with a key of what decides it."""
