"""Watches a running rig between jumps: alarms that begin once and end once, from one health record after the other."""
