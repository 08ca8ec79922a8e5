"""What a robot perceives: infrared, and the camera over the mirror."""
