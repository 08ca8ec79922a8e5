"""Keys by which others have a controller do something, where its user allows that."""
