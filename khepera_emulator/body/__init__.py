"""How a robot moves: motors, drift, chassis, contact, rigid body."""
