"""Clocks and trains of pulses."""
