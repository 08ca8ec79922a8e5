"""A robot as viewers of robots draw it: frames, distances, scenes, topics, a layout, live."""
