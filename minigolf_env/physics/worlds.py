"""Worlds side by side, each with balls of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from minigolf_env.physics.batch import check_clear, shot_of, simulate_rows, sweep_rows
from minigolf_env.physics.types import Hit, Shot
from minigolf_env.physics.world import World, checked_rows


class WorldBatch:
    """Many worlds, asked at once: on all threads, by the same compiled kernels, to the same bits as one by one.

    Where a World takes N rows, a batch of M worlds takes a multiple of M: each world has as many, in their order.

    Args:
        worlds: of one time step ``dt``; none: the batch takes no rows.

    Raises:
        ValueError: different time steps.
    """

    def __init__(self, worlds: Sequence[World]) -> None:
        self.worlds = tuple(worlds)
        steps = {world.dt for world in self.worlds}
        if len(steps) > 1:
            raise ValueError(f"worlds: expected all of one dt, received {sorted(steps)} s.")
        self._scenes = [world.scene for world in self.worlds]

    def simulate_batch(self, positions: ArrayLike, velocities: ArrayLike, max_time: float = 30.0) -> Shot:
        """Run balls from positions (N, 3) with velocities (N, 3), each in its world, as World.simulate_batch does.

        Raises:
            ValueError: as there, or N is no multiple of the number of worlds.
        """
        p, v = checked_rows(positions, velocities, "positions", "velocities")
        each = self._rows_each(len(p))
        check_clear(self._scenes, p, np.repeat([world.scale for world in self.worlds], each))
        steps = max((world.steps(max_time) for world in self.worlds[:1]), default=0)
        return shot_of(p, v, simulate_rows(self._scenes, p, v, steps))

    def sweep_batch(self, starts: ArrayLike, ends: ArrayLike) -> Hit:
        """Return the first collisions from starts (N, 3) to ends (N, 3), m, each in its world, as World.sweep_batch.

        Raises:
            ValueError: as there, or N is no multiple of the number of worlds.
        """
        p, q = checked_rows(starts, ends, "starts", "ends")
        self._rows_each(len(p))
        alphas, normals, triangles = sweep_rows(self._scenes, p, q - p)
        return Hit(triangles >= 0, alphas, normals, triangles)  # type: ignore[arg-type]

    def _rows_each(self, n: int) -> int:
        """Return how many of n rows each world has, or raise a ValueError."""
        many = len(self.worlds)
        if n % many if many else n:
            raise ValueError(f"expected a multiple of {many} rows, as many for each world, received {n}.")
        return n // max(1, many)
