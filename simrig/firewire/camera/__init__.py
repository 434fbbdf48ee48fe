"""The emulated AVT Marlin camera: registers, sensor, configuration ROM."""
