"""Where the cameras of a recording stand, from survey or calibration, and whether they stood still."""
