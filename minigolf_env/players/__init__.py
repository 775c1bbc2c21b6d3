"""Players of the game: random, search, and trained models behind one interface."""
