"""What people and other programs ask of the service and hear from it."""
