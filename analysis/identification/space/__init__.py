"""Spots of one pulse in space: how cameras see, the points that rays meet in, what a body looks like."""
