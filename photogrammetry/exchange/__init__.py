"""Files of other programs: COLMAP, OpenCV, PhotoModeler, AICON, surveys; into and out of `svev-network/1`."""
