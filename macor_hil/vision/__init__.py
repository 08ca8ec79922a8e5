"""From a mirror image to the visual features x of a situation."""
