"""Image measurement: where something moves, overviews of a recording."""
