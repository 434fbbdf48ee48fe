"""The rig on the page: cameras, their aim, the check, the sources of the pulses."""
