"""Trainings in the browser: jumpers, recordings from the first tap to the last, signals."""
