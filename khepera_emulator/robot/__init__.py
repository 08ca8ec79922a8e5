"""The robot as a function of time: firmware, robot, emulator, and the robots of one world."""
