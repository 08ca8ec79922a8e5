"""What emulator and controller agree on beside the line: Zenoh keys, payloads and sessions."""
