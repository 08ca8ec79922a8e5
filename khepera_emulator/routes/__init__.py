"""Routes through an arena: what is possible, and arenas made so that a way is."""
