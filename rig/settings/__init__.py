"""The rig file: its model, and reading it strictly."""
