"""The one thread that owns the rig: state machine, set-up and take-down, faults."""
