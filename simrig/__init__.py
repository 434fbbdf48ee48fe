"""The simulated hill: scenario, jumper, renderer, camera simulators, faults."""
