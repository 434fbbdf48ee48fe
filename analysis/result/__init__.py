"""The measured jump: its model, and the file `jumper.json`."""
