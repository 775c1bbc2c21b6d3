"""Tests of the game that is played by hand."""
