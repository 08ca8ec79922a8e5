"""Learning that is kept: trainings that go on, recorded drives, live runs."""
