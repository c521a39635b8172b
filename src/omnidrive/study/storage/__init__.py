"""Stored runs of a study: database, leases and tables."""
