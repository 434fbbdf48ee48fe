"""The images of the simulated hill: what each camera sees at a pulse, and who took it."""
