"""What moves and how, and what cameras measure of it: channels, prior, measurements and their error equations."""
