"""Measurements behind the claims: each script prints a table."""
