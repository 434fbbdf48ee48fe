"""The front door: command line, composition of the running system, process table."""
