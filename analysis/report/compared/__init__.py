"""The page that shows two compared jumps to a coach: what differs, and both at the same places."""
