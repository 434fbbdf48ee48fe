"""What other programs read of our results: camera calibrations for Foxglove and OpenCV."""
