"""The jumper over time: one adjustment of a whole jump, take-off, synchrony of the cameras, live filter."""
