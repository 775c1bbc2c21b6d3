"""How well a policy plays a hole, or levels: strokes over fixed seeds or levels, with confidence intervals."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from minigolf_env._validation import one_of
from minigolf_env.courses.procedural import DIFFICULTIES, PROCEDURAL
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, in_turn
from minigolf_env.envs.samplers import Levels
from minigolf_env.evaluation.benchmark import (
    Interval,
    Played,
    mean_interval,
    play_episode,
    play_together,
    share_with_interval,
    wilson,
    with_interval,
)
from minigolf_env.players.policies import BatchPolicy, Policy

FIRST_SEED = 1_000_000
"""Of the episodes: far from the seeds that training uses."""

BATCH = 4096
"""Most episodes played side by side."""


@dataclass(frozen=True)
class Score:
    """What a player reached; intervals are 95 % confidence intervals."""

    policy: str
    sha256: str | None
    """Of the model's file; None: the player has none."""
    course: str
    difficulty: str | None
    """Of levels; None: on one hole."""
    episodes: int
    first_seed: int
    """Episode i is seeded first_seed + i, or is played on this level."""
    max_strokes: int
    putt_noise: tuple[float, float]
    """Standard deviations of direction (degrees) and speed (share of it)."""
    strokes: float
    """Mean; an episode that is not holed counts max_strokes."""
    strokes_interval: Interval
    holed: float
    """Share of episodes that ended in the cup."""
    holed_interval: Interval
    hole_in_one: float
    hole_in_one_interval: Interval


def evaluate(
    policy: Policy,
    name: str,
    course: str = "dogleg",
    *,
    difficulty: str | None = None,
    episodes: int = 1000,
    first_seed: int = FIRST_SEED,
    max_strokes: int = 10,
    putt_noise: tuple[float, float] = (0.0, 0.0),
    watch: bool = False,
    quiet: bool = False,
) -> Score:
    """Play the episodes of fixed seeds, or on fixed levels from the middle of their tees, and return the score.

    A BatchPolicy plays them side by side, with the same result as one after the other.

    Args:
        policy: the player.
        name: what the score calls it.
        course: the hole, a name or a file; or "procedural" for levels.
        difficulty: of levels.
        episodes: how many, at least 1.
        first_seed: episode i is seeded first_seed + i, or is played on this level.
        max_strokes: of an episode.
        putt_noise: standard deviations of direction (degrees) and speed (share of it).
        watch: whether to show the putts in a window; closing it ends the show, not the evaluation.
        quiet: whether to show no progress.

    Raises:
        ValueError: an argument is not what it should be.
        RenderingError: a window was asked for, and there is no display.
    """
    if episodes < 1:
        raise ValueError(f"episodes: expected at least 1, received {episodes}.")
    if first_seed < 0:
        raise ValueError(f"first_seed: expected at least 0, received {first_seed}.")
    rules: dict[str, Any] = {"observation": policy.observation, "max_strokes": max_strokes, "putt_noise": putt_noise}
    if course == PROCEDURAL:
        difficulty = one_of(DIFFICULTIES[0] if difficulty is None else difficulty, DIFFICULTIES, "difficulty")
        rules |= {"difficulty": difficulty, "tee": "fixed"}
    elif difficulty is not None:
        raise ValueError(f"difficulty: expected with course={PROCEDURAL!r} only, received {difficulty!r}.")
    starts = [_Start.of(course, first_seed, k) for k in range(episodes)]
    if isinstance(policy, BatchPolicy) and not watch:
        played = _play_together(policy, course, starts, rules)
    else:
        bar = tqdm(starts, f"{name} plays", leave=False, disable=quiet or None)
        with contextlib.closing(MiniGolfEnv(course, "human" if watch else None, **rules)) as env:
            played = [play_episode(env, policy, *start) for start in bar]
    strokes, holed = (np.array(column) for column in zip(*played, strict=True))
    aces = int((holed & (strokes == 1)).sum())
    return Score(
        policy=name,
        sha256=getattr(policy, "sha256", None),
        course=course,
        difficulty=difficulty,
        episodes=episodes,
        first_seed=first_seed,
        max_strokes=max_strokes,
        putt_noise=putt_noise,
        strokes=float(strokes.mean()),
        strokes_interval=mean_interval(strokes),
        holed=float(holed.mean()),
        holed_interval=wilson(int(holed.sum()), episodes),
        hole_in_one=aces / episodes,
        hole_in_one_interval=wilson(aces, episodes),
    )


class _Start(NamedTuple):
    """How an episode is reset."""

    seed: int
    options: dict[str, int]
    """The level, or the hole of a round."""

    @staticmethod
    def of(course: str, first: int, episode: int) -> _Start:
        """Return the start of an episode, counted from 0."""
        number = first + episode
        return _Start(number, {Levels.key: number} if course == PROCEDURAL else in_turn(course, episode))


def _play_together(policy: BatchPolicy, course: str, starts: Sequence[_Start], rules: dict[str, Any]) -> list[Played]:
    played: list[Played] = []
    for i in range(0, len(starts), BATCH):
        batch = starts[i : i + BATCH]
        # Who has finished begins anew, without a count: on one level, not on others that would have to be made.
        again: dict[str, Any] = {"start_level": batch[0].seed, "num_levels": 1} if course == PROCEDURAL else {}
        envs = MiniGolfVectorEnv(len(batch), course, **rules, **again)
        options = {key: [start.options[key] for start in batch] for key in batch[0].options}
        played += play_together(envs, policy, batch[0].seed, options)
    return played


def print_scores(scores: Sequence[Score]) -> None:
    """Print one table, a row for each player."""
    from rich.console import Console
    from rich.table import Table

    first = scores[0]
    noise = "noise of {:g} degrees and {:.1%}, ".format(*first.putt_noise) if any(first.putt_noise) else ""
    course = first.course if first.difficulty is None else f"{first.course}, {first.difficulty}"
    table = Table(title=f"{course}: {noise}fixed seeds, [95 % confidence intervals]")
    for column in ("player", "episodes", "mean strokes", "holed out", "hole-in-one"):
        table.add_column(column, justify="left" if column == "player" else "right")
    for score in scores:
        table.add_row(
            score.policy,
            str(score.episodes),
            with_interval(score.strokes, score.strokes_interval),
            share_with_interval(score.holed, score.holed_interval),
            share_with_interval(score.hole_in_one, score.hole_in_one_interval),
        )
    Console().print(table)
