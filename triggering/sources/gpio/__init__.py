"""Pulses from a line of the computer, through libgpiod."""
