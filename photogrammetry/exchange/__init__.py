"""Files of other programs: COLMAP, OpenCV, PhotoModeler, AICON, surveys; carried over into `svev-network/1`."""
