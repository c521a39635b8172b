"""How the planned runs of a study are computed and recorded."""
