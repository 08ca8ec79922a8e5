"""The suite of arenas: systems beside what is possible, and by how much they learn."""
