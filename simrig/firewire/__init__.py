"""An emulated FireWire bus with AVT Marlin cameras, for Debian's unmodified libdc1394."""
