"""The benchmark: a policy on fixed training levels and held-out levels of each difficulty, compared with search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from minigolf_env._validation import integer, one_of
from minigolf_env.courses.procedural import DIFFICULTY_NAMES, PROCEDURAL_COURSE
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.config import ignore_unseen_levels
from minigolf_env.evaluation import FIRST_EVALUATION_SEED, NUM_EVALUATION_SEEDS
from minigolf_env.evaluation.rollout import EpisodeResult, run_episode, run_episodes_batched, search_strokes
from minigolf_env.evaluation.statistics import Interval, mean_interval, ratio_interval, wilson_interval
from minigolf_env.players.policies import BatchPolicy, Policy, load_policy, warn_if_untrained

FIRST_TRAINING_LEVEL = 0
"""Number of the first training level."""


@dataclass(frozen=True)
class LevelSetResult:
    """The scores of a policy on a set of levels; all intervals are 95 % confidence intervals."""

    difficulty: str
    """Difficulty of the levels."""
    level_set: str
    """Name of the set: "train" or "held out"."""
    first_level: int
    """Number of the first level."""
    num_levels: int
    """Number of levels; each is played once."""
    strokes: float
    """Mean number of strokes of a level; one that is not holed counts the largest number of strokes."""
    strokes_interval: Interval
    """Confidence interval of the mean number of strokes."""
    relative: float
    """Total number of strokes divided by that of search from the same tees."""
    relative_interval: Interval
    """Confidence interval of the strokes relative to search."""
    holed: float
    """Fraction of the episodes that ended in the cup."""
    holed_interval: Interval
    """Confidence interval of the fraction of the episodes that ended in the cup."""
    by_level: tuple[EpisodeResult, ...]
    """Result on each level."""
    search_by_level: tuple[int, ...]
    """Strokes of search on each level."""


def benchmark(
    policy_name: str,
    difficulties: Sequence[str] = DIFFICULTY_NAMES,
    num_levels: int = 200,
    max_strokes: int = 10,
    seed: int = 0,
) -> Iterator[LevelSetResult]:
    """Yield a policy's scores on the first training levels and the first held-out levels of each difficulty.

    Every level is played once, from the middle of its tee, without noise. Only a random policy depends on ``seed``.

    Args:
        policy_name: name or file of the policy, as ``load_policy`` takes it.
        difficulties: names of ``courses.procedural.DIFFICULTY_NAMES``.
        num_levels: number of levels in each set, at least 1.
        max_strokes: largest number of strokes of an episode.
        seed: seed of a random policy.

    Raises:
        ValueError, FileNotFoundError, ImportError: there is no such policy or difficulty, or ``num_levels`` is not
            from 1 to NUM_EVALUATION_SEEDS, so that the sets do not overlap.
    """
    integer(num_levels, "levels", 1, NUM_EVALUATION_SEEDS)
    integer(seed, "seed", 0)
    if not difficulties:
        raise ValueError(f"difficulty: expected one or more of {', '.join(DIFFICULTY_NAMES)}, received none.")
    checked = [one_of(difficulty, DIFFICULTY_NAMES, "difficulty") for difficulty in difficulties]
    policy = load_policy(policy_name, seed)
    warn_if_untrained(policy, PROCEDURAL_COURSE)
    for difficulty in checked:
        env_args: dict[str, Any] = {
            "difficulty": difficulty,
            "max_strokes": max_strokes,
            "tee": "fixed",
            "observation": policy.observation,
        }
        for level_set, first in (("train", FIRST_TRAINING_LEVEL), ("held out", FIRST_EVALUATION_SEED)):
            policy = load_policy(policy_name, seed)  # A new one: a set's scores do not depend on the sets before it.
            with ignore_unseen_levels():
                result = _evaluate_set(policy, level_set, range(first, first + num_levels), env_args)
            yield result


def _evaluate_set(policy: Policy, level_set: str, levels: range, env_args: dict[str, Any]) -> LevelSetResult:
    """Play each level once with search and once with a policy, and return the policy's scores."""
    env = MiniGolfEnv(PROCEDURAL_COURSE, **env_args)
    results: list[EpisodeResult] = []
    references: list[int] = []
    for level in tqdm(levels, f"{env_args['difficulty']}, {level_set}", leave=False, disable=None):
        env.reset(options={"level": level})
        references.append(search_strokes(env))
        if not isinstance(policy, BatchPolicy):
            results.append(run_episode(env, policy, None, {"level": level}))
    if isinstance(policy, BatchPolicy):
        envs = MiniGolfVectorEnv(len(levels), PROCEDURAL_COURSE, start_level=levels.start, num_levels=1, **env_args)
        results = run_episodes_batched(envs, policy, None, {"level": list(levels)})
    return _summarize(env_args["difficulty"], level_set, levels.start, results, references, env_args["max_strokes"])


def _summarize(
    difficulty: str,
    level_set: str,
    first: int,
    results: list[EpisodeResult],
    references: list[int],
    max_strokes: int,
) -> LevelSetResult:
    strokes = np.array([episode.strokes for episode in results])
    num_holed = sum(episode.holed for episode in results)
    return LevelSetResult(
        difficulty=difficulty,
        level_set=level_set,
        first_level=first,
        num_levels=len(results),
        strokes=float(strokes.mean()),
        strokes_interval=mean_interval(strokes, 1.0, max_strokes),
        relative=float(strokes.mean() / np.mean(references)),
        relative_interval=ratio_interval(strokes, references, 1.0 / max_strokes, max_strokes),
        holed=num_holed / len(results),
        holed_interval=wilson_interval(num_holed, len(results)),
        by_level=tuple(results),
        search_by_level=tuple(references),
    )
