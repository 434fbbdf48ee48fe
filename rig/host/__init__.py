"""What this computer has: its disk, and how well it knows UTC."""
