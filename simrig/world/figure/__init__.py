"""The body of the simulated jumper: its parts, the hiding of one by another, its mass."""
