"""Policies that play the game: random, search, and trained models behind one interface."""
