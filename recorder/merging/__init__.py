"""Joins logs that several computers recorded of the same pulses."""
