"""What this computer has: disk, network ports, how well it knows UTC; and the signals that end a program."""
