"""Ways of seeing a world all around from a point: PyBullet's own, and a fast one."""
