"""The kinogram: five pictures of a jump at fixed places with its main figures, as a page and as a picture to send."""
