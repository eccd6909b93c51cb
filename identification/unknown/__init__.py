"""What no cause of the catalogue explains: which channel, what it depends on, the curve and a closed form."""
