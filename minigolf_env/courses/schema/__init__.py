"""Format of course files: pydantic records of every table, limits on size, and the built-in surfaces."""
