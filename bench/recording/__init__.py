"""What recording costs: beside GStreamer, part by part, on FireWire."""
