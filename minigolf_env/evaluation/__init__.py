"""Evaluation of policies: rollouts, statistics with confidence intervals, and the benchmark on fixed sets of levels."""
