"""Trigger pulses: the cameras' clocks on a common time line, pairing of frames by pulse, and the account of a log."""
