"""Ways to reach an emulated robot: a pseudo-terminal, and a pySerial URL."""
