"""Makes a whole log of an unfinished or damaged one."""
