"""The body of the simulated jumper: of what it is made, what hides what, where its mass is."""
