"""Sample programs: run them from the repository's root, read them, change them."""
