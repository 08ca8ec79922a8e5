"""Uses of a controller with its devices: live runs, trainings, trials."""
