"""The child processes of a rig: the object that starts and watches them; `programs` is what they do."""
