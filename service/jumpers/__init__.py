"""Who jumps: the start list and the next jumper, seen and changed by all, kept over restarts."""
