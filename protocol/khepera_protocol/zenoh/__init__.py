"""The Zenoh layer of emulator, controller and player: keys, payloads, sessions and samples."""
