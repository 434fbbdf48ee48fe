"""Where the pulses come from, at the running service."""
