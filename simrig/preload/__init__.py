"""Small C libraries that are loaded before libc, to show a process devices that are not there."""
