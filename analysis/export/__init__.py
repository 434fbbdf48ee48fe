"""What other programs read of our results: CSV, C3D, TRC; camera calibrations for Foxglove and OpenCV."""
