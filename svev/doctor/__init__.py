"""`svev doctor`: examines what a recording needs (computer, network, disk, cameras) before the recording."""
