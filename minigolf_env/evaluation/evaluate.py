"""Evaluate a policy on a hole, a round or procedural levels: strokes over fixed seeds or levels."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from minigolf_env._validation import integer, one_of, quote
from minigolf_env.courses.procedural import DIFFICULTY_NAMES, PROCEDURAL_COURSE
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, round_reset_options
from minigolf_env.envs.config import ignore_unseen_levels
from minigolf_env.envs.samplers import LevelSampler
from minigolf_env.evaluation import FIRST_EVALUATION_SEED, NUM_EVALUATION_SEEDS
from minigolf_env.evaluation.rollout import EpisodeResult, run_episode, run_episodes_batched
from minigolf_env.evaluation.statistics import Interval, mean_interval, wilson_interval
from minigolf_env.players.policies import BatchPolicy, Policy, warn_if_untrained

MAX_BATCH_EPISODES = 4096
"""Largest number of episodes played at once in one batch."""


@dataclass(frozen=True)
class EvaluationResult:
    """The scores of a policy; all intervals are 95 % confidence intervals."""

    policy: str
    """Name of the policy."""
    sha256: str | None
    """SHA-256 of the model file; None for a policy without a file."""
    course: str
    """Name or file of the hole, "round" or "procedural"."""
    difficulty: str | None
    """Difficulty of the levels; None on one hole."""
    episodes: int
    """Number of episodes."""
    first_seed: int
    """Episode i is seeded with first_seed + i, or is played on the level of that number."""
    max_strokes: int
    """Largest number of strokes of an episode."""
    putt_noise: tuple[float, float]
    """Standard deviations of a putt's direction (degrees) and speed (fraction of it)."""
    strokes: float
    """Mean number of strokes of an episode; one that is not holed counts max_strokes."""
    strokes_interval: Interval
    """Confidence interval of the mean number of strokes."""
    holed: float
    """Fraction of the episodes that ended in the cup."""
    holed_interval: Interval
    """Confidence interval of the fraction of the episodes that ended in the cup."""
    hole_in_one: float
    """Fraction of the episodes that ended in the cup after one stroke."""
    hole_in_one_interval: Interval
    """Confidence interval of the fraction of holes-in-one."""


def evaluate(
    policy: Policy,
    policy_name: str,
    course: str = "dogleg",
    *,
    difficulty: str | None = None,
    episodes: int = 1000,
    first_seed: int = FIRST_EVALUATION_SEED,
    max_strokes: int = 10,
    putt_noise: tuple[float, float] = (0.0, 0.0),
    watch: bool = False,
    quiet: bool = False,
) -> EvaluationResult:
    """Play episodes with fixed seeds, or on fixed levels from the middle of their tees, and return the scores.

    A BatchPolicy plays the episodes in batches, with the same result as one after another.

    Args:
        policy: the policy to evaluate.
        policy_name: name of the policy in the result and the progress bar.
        course: the hole, a name or a file; "round" for its nine holes in turn; "procedural" for levels.
        difficulty: difficulty of the levels; only with "procedural".
        episodes: number of episodes, from 1 to NUM_EVALUATION_SEEDS.
        first_seed: episode i is seeded with first_seed + i, or is played on the level of that number.
        max_strokes: largest number of strokes of an episode.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (fraction of it).
        watch: show the putts in a window. Closing the window does not end the evaluation.
        quiet: show no progress bar.

    Raises:
        ValueError: an argument is invalid.
        RenderingError: ``watch`` is True and there is no display.
    """
    # Check the arguments.
    integer(episodes, "episodes", 1, NUM_EVALUATION_SEEDS)
    integer(first_seed, "first_seed", 0)
    env_args: dict[str, Any] = {"max_strokes": max_strokes, "putt_noise": putt_noise}
    env_args["observation"] = policy.observation
    if course == PROCEDURAL_COURSE:
        difficulty = one_of(DIFFICULTY_NAMES[0] if difficulty is None else difficulty, DIFFICULTY_NAMES, "difficulty")
        env_args |= {"difficulty": difficulty, "tee": "fixed"}
    elif difficulty is not None:
        raise ValueError(
            f"difficulty: expected with course={quote(PROCEDURAL_COURSE)} only, received {quote(difficulty)}."
        )
    warn_if_untrained(policy, str(course))
    # Play the episodes.
    starts = [_EpisodeStart.of(course, first_seed, k) for k in range(episodes)]
    with ignore_unseen_levels():
        if isinstance(policy, BatchPolicy) and not watch:
            results = _run_batches(policy, course, starts, env_args)
        else:
            progress = tqdm(starts, f"{policy_name} plays", leave=False, disable=quiet or None)
            results = _run_one_by_one(policy, course, progress, watch, env_args)
    # Summarize the results.
    strokes, holed = (np.array(column) for column in zip(*results, strict=True))
    num_holes_in_one = int((holed & (strokes == 1)).sum())
    return EvaluationResult(
        policy=policy_name,
        sha256=getattr(policy, "sha256", None),
        course=course,
        difficulty=difficulty,
        episodes=episodes,
        first_seed=first_seed,
        max_strokes=max_strokes,
        putt_noise=putt_noise,
        strokes=float(strokes.mean()),
        strokes_interval=mean_interval(strokes, 1.0, max_strokes),
        holed=float(holed.mean()),
        holed_interval=wilson_interval(int(holed.sum()), episodes),
        hole_in_one=num_holes_in_one / episodes,
        hole_in_one_interval=wilson_interval(num_holes_in_one, episodes),
    )


class _EpisodeStart(NamedTuple):
    """Arguments of the reset that starts an episode."""

    seed: int
    """Seed of the environment."""
    options: dict[str, int]
    """Reset options: the number of the level, or of the hole in a round."""

    @staticmethod
    def of(course: str, first_seed: int, episode: int) -> _EpisodeStart:
        """Return the start of an episode, counted from 0."""
        seed = first_seed + episode
        if course == PROCEDURAL_COURSE:
            return _EpisodeStart(seed, {LevelSampler.index_name: seed})
        return _EpisodeStart(seed, round_reset_options(course, episode))


def _run_one_by_one(
    policy: Policy, course: str, starts: Iterable[_EpisodeStart], watch: bool, env_args: dict[str, Any]
) -> list[EpisodeResult]:
    with contextlib.closing(MiniGolfEnv(course, "human" if watch else None, **env_args)) as env:
        return [run_episode(env, policy, *start) for start in starts]


def _run_batches(
    policy: BatchPolicy, course: str, starts: Sequence[_EpisodeStart], env_args: dict[str, Any]
) -> list[EpisodeResult]:
    results: list[EpisodeResult] = []
    for i in range(0, len(starts), MAX_BATCH_EPISODES):
        batch = starts[i : i + MAX_BATCH_EPISODES]
        # Environments that have ended are reset to uncounted episodes. With one level no further levels are generated.
        levels: dict[str, Any] = {"start_level": batch[0].seed, "num_levels": 1} if course == PROCEDURAL_COURSE else {}
        envs = MiniGolfVectorEnv(len(batch), course, **env_args, **levels)
        options = {key: [start.options[key] for start in batch] for key in batch[0].options}
        results += run_episodes_batched(envs, policy, batch[0].seed, options)
    return results
