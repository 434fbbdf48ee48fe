"""FireWire back end: the unmodified libdc1394 in this process, on the emulated bus."""
