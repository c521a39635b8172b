"""Commands on fuzzy systems in files."""
