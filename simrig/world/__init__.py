"""What happens on the simulated hill: scenario, jumper, trigger pulses, camera clocks, faults; and the truth of it."""
