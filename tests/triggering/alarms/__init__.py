"""What is wrong while a rig is armed."""
