"""The devices of a controller: the robot on its serial line, and a camera."""
