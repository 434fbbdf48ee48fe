"""What became of every pulse in every camera: counted from the tags, and recomputed from what a log holds."""
