"""Files of fuzzy systems."""
