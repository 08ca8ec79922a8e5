"""What a controller does with its devices: live runs, trainings, trials."""
