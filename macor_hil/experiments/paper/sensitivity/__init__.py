"""A map of table 1's settings: how far each system drives when one or two of them are changed."""
