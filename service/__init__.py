"""The running rig: its processes, the supervisor that owns them, recordings, status; with and without the panel."""
