"""The child processes of a rig: their programs, and the object that starts and watches them."""
