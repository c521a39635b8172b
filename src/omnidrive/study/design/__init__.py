"""What a study varies, and the runs that it plans."""
