"""FireWire cameras (IIDC) through libdc1394 2.2."""
