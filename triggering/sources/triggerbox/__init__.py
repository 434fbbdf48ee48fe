"""Pulses of a trigger box: a timer on a serial line, told its rate and asked again and again how far it has counted."""
