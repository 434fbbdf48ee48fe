"""`svev doctor`: looks at everything that a recording stands on, before the recording."""
