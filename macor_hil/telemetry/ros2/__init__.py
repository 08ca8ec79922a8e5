"""ROS 2 without ROS: what the controller tells, as ROS 2 topics over Zenoh."""
