"""An emulated FireWire bus with AVT Marlin cameras, which Debian's unmodified libdc1394 drives."""
