"""Data that the controller publishes over Zenoh, their recordings, and their form for ROS 2."""
