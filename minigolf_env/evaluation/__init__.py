"""Evaluation of policies: rollouts, statistics with confidence intervals, and the benchmark on fixed sets of levels."""

FIRST_EVALUATION_SEED = 1_000_000
"""First seed, or first held-out level, of evaluations; no sample program uses 1,000,000 to 1,999,999 in training."""
