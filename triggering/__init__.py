"""Pulses: device clocks on a common time line, pulse numbering and pairing."""
