"""ROS 2 without ROS: the controller's samples as ROS 2 topics over Zenoh."""
