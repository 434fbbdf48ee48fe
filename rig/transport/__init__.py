"""Child processes of a rig, and what passes between processes: messages, rings and preview in shared memory."""
