"""What Gymnasium and the rules of the game promise."""
