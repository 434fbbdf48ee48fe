"""FireWire cameras (IIDC) through libdc1394 2.2 as the distribution ships it."""
