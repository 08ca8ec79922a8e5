"""The program around the emulator: daemon, side channel, replay, command line."""
