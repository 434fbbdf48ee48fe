"""Pictures: what their pixels are, how they are looked at, and where a camera looks."""
