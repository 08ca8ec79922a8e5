"""Planners: from the present neuron and the map to the next command."""
