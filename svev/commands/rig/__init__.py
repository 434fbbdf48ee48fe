"""Commands that run a rig: record, rehearse, serve, operate a running service."""
