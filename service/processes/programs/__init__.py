"""Programs of the processes of a rig: what each does from its start until it is told to quit."""
