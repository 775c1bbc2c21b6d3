"""How well a policy plays: strokes, their intervals, records of them, and the benchmark on fixed sets of levels."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from minigolf_env import __version__
from minigolf_env._atomic_io import write_text
from minigolf_env._validation import one_of
from minigolf_env.courses.procedural import DIFFICULTIES, GENERATOR, PROCEDURAL
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.players.policies import BatchPolicy, Policy, load_policy
from minigolf_env.players.search import search

Z = 1.96
"""Two-sided 95 % quantile of the normal distribution."""

Interval = tuple[float, float]

HELD_OUT = 1_000_000
"""The first held-out level: far beyond the levels that anyone trains on, which start at 0."""

TRAIN = 0
"""The first training level."""


class Played(NamedTuple):
    """One episode."""

    strokes: int
    holed: bool


@dataclass(frozen=True)
class SetScore:
    """What a policy reached on a set of levels; intervals are 95 % confidence intervals."""

    difficulty: str
    levels: str
    """"train" or "held out"."""
    first_level: int
    num_levels: int
    strokes: float
    """Mean; an episode that is not holed counts the most strokes."""
    strokes_interval: Interval
    relative: float
    """Strokes in all over those of search from the same tees."""
    relative_interval: Interval
    holed: float
    """Share of episodes that ended in the cup."""
    holed_interval: Interval
    by_level: tuple[Played, ...]
    search_by_level: tuple[int, ...]


def play_episode(
    env: gym.Env[Any, Any], policy: Policy, seed: int | None, options: dict[str, Any] | None = None
) -> Played:
    """Return how an episode from a reset with a seed and options went."""
    observation, info = env.reset(seed=seed, options=options)
    over = False
    while not over:
        action = policy.act(observation, cast(MiniGolfEnv, env.unwrapped))
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    return Played(info["strokes"], info["is_success"])


def play_together(
    envs: MiniGolfVectorEnv, policy: BatchPolicy, seed: int | None, options: dict[str, Any] | None = None
) -> list[Played]:
    """Return how an episode in each environment of a NextStep batch went, from a reset with a seed and options.

    It goes as ``play_episode`` does with seed + i in environment i.
    """
    observations, _ = envs.reset(seed=seed, options=options)
    strokes = np.zeros(envs.num_envs, np.int64)
    holed, over = np.zeros((2, envs.num_envs), np.bool_)
    while not over.all():
        # Who has finished goes on without a count, with putts that cost nothing.
        putts = np.where(over[:, None], np.float32(0.0), policy.act_many(observations))
        observations, _, terminated, truncated, infos = envs.step(putts)
        ended = (terminated | truncated) & ~over
        strokes[ended], holed[ended] = infos["strokes"][ended], infos["is_success"][ended]
        over |= ended
    return [Played(*episode) for episode in zip(strokes.tolist(), holed.tolist(), strict=True)]


def strokes_of_search(env: MiniGolfEnv) -> int:
    """Play on with search and return the strokes of the episode in its end."""
    over = False
    while not over:
        _, _, over, _, info = env.step(search(env).action)
    return int(info["strokes"])


def mean_interval(values: ArrayLike) -> Interval:
    """Return the 95 % interval of a mean, by the normal distribution."""
    array = np.asarray(values, dtype=np.float64)
    margin = Z * float(array.std(ddof=1)) / math.sqrt(len(array)) if len(array) > 1 else math.inf
    return float(array.mean() - margin), float(array.mean() + margin)


def ratio_interval(values: ArrayLike, references: ArrayLike) -> Interval:
    """Return the 95 % interval of the ratio of two means of pairs (W. G. Cochran, Sampling Techniques, 1977, 6.4)."""
    x, y = np.asarray(values, dtype=np.float64), np.asarray(references, dtype=np.float64)
    ratio = float(x.mean() / y.mean())
    low, high = mean_interval(x - ratio * y)
    return ratio + low / float(y.mean()), ratio + high / float(y.mean())


def wilson(successes: int, n: int) -> Interval:
    """Return the 95 % interval of a share (E. B. Wilson, 1927), which is sound near 0 and 1 too."""
    share = successes / n
    centre = share + Z * Z / (2 * n)
    spread = Z * math.sqrt(share * (1 - share) / n + Z * Z / (4 * n * n))
    return max(0.0, (centre - spread) / (1 + Z * Z / n)), min(1.0, (centre + spread) / (1 + Z * Z / n))


def benchmark(
    name: str,
    difficulties: Sequence[str] = DIFFICULTIES,
    levels: int = 200,
    max_strokes: int = 10,
    seed: int = 0,
) -> Iterator[SetScore]:
    """Yield a policy's scores on the first training levels and as many held-out ones, of each difficulty.

    Every level is played once, from the middle of its tee, without noise: only a random policy depends on ``seed``.

    Args:
        name: a policy, as ``load_policy`` takes it.
        difficulties: of ``courses.procedural.DIFFICULTIES``.
        levels: of each set.
        max_strokes: of an episode.
        seed: of a random policy.

    Raises:
        ValueError, FileNotFoundError, ImportError: there is no such policy or difficulty, or ``levels`` is below 1.
    """
    if levels < 1:
        raise ValueError(f"levels: expected at least 1, received {levels}.")
    if not difficulties:
        raise ValueError(f"difficulty: expected one or more of {', '.join(DIFFICULTIES)}, received none.")
    known = [one_of(difficulty, DIFFICULTIES, "difficulty") for difficulty in difficulties]
    seen = load_policy(name, seed).observation
    for difficulty in known:
        rules: dict[str, Any] = {"difficulty": difficulty, "max_strokes": max_strokes, "tee": "fixed"}
        rules |= {"observation": seen}
        env = MiniGolfEnv(PROCEDURAL, **rules)
        for what, first in (("train", TRAIN), ("held out", HELD_OUT)):
            policy = load_policy(name, seed)  # Anew: a set's score does not depend on what was scored before it.
            played, reference = [], []
            numbers = range(first, first + levels)
            for level in tqdm(numbers, f"{difficulty}, {what}", leave=False, disable=None):
                env.reset(options={"level": level})
                reference.append(strokes_of_search(env))
                if not isinstance(policy, BatchPolicy):
                    played.append(play_episode(env, policy, None, {"level": level}))
            if isinstance(policy, BatchPolicy):
                envs = MiniGolfVectorEnv(levels, PROCEDURAL, start_level=first, num_levels=1, **rules)
                played = play_together(envs, policy, None, {"level": list(numbers)})
            yield _score(difficulty, what, first, played, reference)


def _score(difficulty: str, what: str, first: int, played: list[Played], reference: list[int]) -> SetScore:
    strokes = np.array([episode.strokes for episode in played])
    holed = sum(episode.holed for episode in played)
    return SetScore(
        difficulty=difficulty,
        levels=what,
        first_level=first,
        num_levels=len(played),
        strokes=float(strokes.mean()),
        strokes_interval=mean_interval(strokes),
        relative=float(strokes.mean() / np.mean(reference)),
        relative_interval=ratio_interval(strokes, reference),
        holed=holed / len(played),
        holed_interval=wilson(holed, len(played)),
        by_level=tuple(played),
        search_by_level=tuple(reference),
    )


def write_record(path: Path, *libraries: str, **record: Any) -> None:
    """Write a record to a JSON file, never half of it, with the versions it was made with: of these libraries too.

    The file's folder is made. Ends of an interval that are infinite (of a single episode) are null, as JSON has it.
    """
    versions = {name: metadata.version(name) for name in ("gymnasium", "numpy", "numba", *libraries)}
    versions |= {"minigolf_env": __version__, "levels": str(GENERATOR), "python": platform.python_version()}
    text = json.dumps(_finite({**record, "versions": versions}), indent=2, allow_nan=False)
    write_text(path, text + "\n")


def _finite(value: Any) -> Any:
    """Return a record with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_benchmark(policy: str, scores: Sequence[SetScore]) -> None:
    """Print one table, a row for each set."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{policy} on levels v{GENERATOR}, [95 % confidence intervals]")
    for column in ("difficulty", "levels", "episodes", "mean strokes", "relative to search", "holed out"):
        table.add_column(column, justify="left" if column in ("difficulty", "levels") else "right")
    for score in scores:
        table.add_row(
            score.difficulty,
            score.levels,
            str(score.num_levels),
            with_interval(score.strokes, score.strokes_interval),
            with_interval(score.relative, score.relative_interval),
            share_with_interval(score.holed, score.holed_interval),
        )
    Console().print(table)


def with_interval(value: float, interval: Interval) -> str:
    """Return a number and its interval as text."""
    return f"{value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]"


def share_with_interval(share: float, interval: Interval) -> str:
    """Return a share and its interval as text, in percent."""
    return f"{share:.1%} [{100 * interval[0]:.0f}, {100 * interval[1]:.0f}]"
