"""What this computer has: its disk, how well it knows UTC; and the signals that end a program."""
