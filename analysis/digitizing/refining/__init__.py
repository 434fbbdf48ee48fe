"""A click, found more exactly in its image."""
