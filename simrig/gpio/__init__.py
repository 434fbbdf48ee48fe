"""An emulated GPIO chip, which the unmodified libgpiod opens as `/dev/gpiochipN` of the kernel."""
