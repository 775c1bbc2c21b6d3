"""Applications: the game, videos of policies, the course check, galleries and putt maps."""
