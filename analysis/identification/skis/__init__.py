"""Which traces show which ski."""
