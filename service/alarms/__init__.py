"""Tells people who are elsewhere what befalls the rig: notifications by webhook."""
