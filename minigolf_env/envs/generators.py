"""Random number generators of environments: seeding those of a batch, and restoring them after an error."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from minigolf_env._validation import quote
from minigolf_env.envs.config import one_per_env


def seed_generators(
    rngs: NDArray[np.object_], seed: int | Sequence[int | None] | None, rows: NDArray[np.int64], num_envs: int
) -> tuple[NDArray[np.object_], dict[int, int]]:
    """Return the generators (num_envs,) of a batch after seeding some, and the seeds of those by their index.

    Args:
        rngs: the generators so far, which are not changed; empty before the first reset, which seeds all.
        seed: of environment 0, environment i gets seed + i; or one for each environment. None leaves a generator as it
            is.
        rows: the environments that are reset.
        num_envs: number of environments.

    Raises:
        ValueError: the number of seeds is wrong.
    """
    if seed is None or isinstance(seed, (int, np.integer)):
        seeds = [None if seed is None else int(seed) + i for i in range(num_envs)]
    else:
        seeds = one_per_env(seed, num_envs, "seed")
    is_first = len(rngs) == 0
    seeded = [i for i in rows.tolist() if is_first or seeds[i] is not None]
    result = np.full(num_envs, None, dtype=object) if is_first else rngs.copy()
    used: dict[int, int] = {}
    for i in seeded:
        result[i], used[i] = seeding.np_random(seeds[i])
    return result, used


def check_generators(values: Any, num_envs: int) -> NDArray[np.object_]:
    """Return generators (num_envs,), or raise a ValueError unless they are different ones of numpy's PCG64."""
    rngs = one_per_env(values, num_envs, "np_random")
    bit_generators = [rng.bit_generator for rng in rngs if isinstance(rng, np.random.Generator)]
    distinct = {id(source) for source in bit_generators if type(source) is np.random.PCG64}
    if len(distinct) < num_envs:
        raise ValueError(
            f"np_random: expected {num_envs} different generators of numpy's PCG64, received {quote(rngs)}; "
            "environments that shared one would disturb each other."
        )
    return np.array(rngs, dtype=object)


@contextmanager
def restore_on_error(rngs: Iterable[np.random.Generator]) -> Iterator[None]:
    """Set generators back to their states if the block raises."""
    states = [(rng, rng.bit_generator.state) for rng in rngs]
    try:
        yield
    except BaseException:
        for rng, state in states:
            rng.bit_generator.state = state
        raise
