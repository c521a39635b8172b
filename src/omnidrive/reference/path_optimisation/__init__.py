"""Minimum-time motions whose path is optimised within free space."""
