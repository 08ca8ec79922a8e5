"""The operating system: signals, locks, waiting, and what differs from one to another."""
