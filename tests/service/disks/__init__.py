"""Disks that are full, slow, broken or cut off."""
