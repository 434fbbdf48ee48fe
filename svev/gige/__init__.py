"""GigE Vision cameras outside of a recording: who is there, which features they have, which addresses they get."""
