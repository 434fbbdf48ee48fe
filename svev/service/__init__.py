"""The service on the hill-side PC: owns the running rig, and does what the panel asks."""
