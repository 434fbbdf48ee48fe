"""Recordings that begin by themselves."""
