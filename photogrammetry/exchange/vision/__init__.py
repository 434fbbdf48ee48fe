"""Files of computer vision (OpenCV, COLMAP, anipose): y down, z forward."""
