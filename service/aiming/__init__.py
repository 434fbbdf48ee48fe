"""Where the cameras should show the balls, for those who aim them."""
