"""Which spots show which marker, the right and the left one told apart."""
