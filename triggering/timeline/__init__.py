"""The common time line: clocks of the cameras on the host's clock, and the rhythm of the pulses."""
