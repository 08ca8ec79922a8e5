"""Motion of a robot: motors, drift, chassis, contact, rigid body."""
