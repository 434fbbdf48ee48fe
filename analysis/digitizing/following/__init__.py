"""What was marked, followed through the pulses."""
