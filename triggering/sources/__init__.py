"""Who makes the trigger pulses: one seam for all sources of `[trigger] source`."""
