"""Cameras that play a recorded log into the rig."""
