"""Measuring by hand: what a person marks in the images of a log, kept action by action, and what follows in space."""
