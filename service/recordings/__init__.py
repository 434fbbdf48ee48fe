"""Recordings: the one in progress, those in the folder, room on the disk for more."""
