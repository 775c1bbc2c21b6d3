"""Evaluation of policies: rollouts, statistics with confidence intervals, and the benchmark on fixed sets of levels."""

FIRST_EVALUATION_SEED = 1_000_000
"""First seed, or first held-out level, of evaluations."""

NUM_EVALUATION_SEEDS = 1_000_000
"""Number of held-out levels: no sample program trains on them or chooses a checkpoint by them."""
