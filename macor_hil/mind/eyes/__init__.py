"""Eyes: from a picture to the visual features of a situation."""
