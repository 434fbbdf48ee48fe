"""What pulses say of each other: flights, the pulses around one, prediction, and what fits it."""
