"""The world of the robots: solids, floor plan, free space, and PyBullet's copy of them."""
