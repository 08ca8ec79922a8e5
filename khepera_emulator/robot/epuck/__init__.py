"""The e-puck and the e-puck2: stepper motors, two firmwares of the first and one of the second."""
