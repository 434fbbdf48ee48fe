"""Commands of photogrammetry: adjust, calibrate, orient, plan, import."""
