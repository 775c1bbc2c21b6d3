"""Tests of the environments: Gymnasium's interface and the rules of the game."""
