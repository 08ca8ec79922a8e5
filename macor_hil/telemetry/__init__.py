"""What the controller tells the world over Zenoh: keys, payloads and the publisher."""
