"""The simulated hill: a scenario, the jumper and the images that it shows, simulated cameras of both buses, faults."""
