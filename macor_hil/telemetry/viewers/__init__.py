"""A robot as viewers of robots draw it: frames, distances, prisms, scenes, topics, layout, live."""
