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
        worlds: at least one, of one time step ``dt``.

    Raises:
        ValueError: no world, or different time steps.
    """

    def __init__(self, worlds: Sequence[World]) -> None:
        self.worlds = tuple(worlds)
        steps = {world.dt for world in self.worlds}
        if len(steps) != 1:
            raise ValueError(f"worlds: expected at least one, all of one dt, received dt of {sorted(steps)}.")
        self._scenes = [world.scene for world in self.worlds]

    def simulate_batch(self, positions: ArrayLike, velocities: ArrayLike, max_time: float = 30.0) -> Shot:
        """Run balls from positions (N, 3) with velocities (N, 3), each in its world, as World.simulate_batch does.

        Raises:
            ValueError: as there, or N is no multiple of the number of worlds.
        """
        p, v = checked_rows(positions, velocities, "positions", "velocities")
        self._check_rows(len(p))
        scales = np.repeat([world.scale for world in self.worlds], len(p) // len(self.worlds))
        check_clear(self._scenes, p, scales)
        results = simulate_rows(self._scenes, p, v, self.worlds[0].steps(max_time))
        return shot_of(p, v, results)

    def sweep_batch(self, starts: ArrayLike, ends: ArrayLike) -> Hit:
        """Return the first collisions from starts (N, 3) to ends (N, 3), m, each in its world, as World.sweep_batch.

        Raises:
            ValueError: as there, or N is no multiple of the number of worlds.
        """
        p, q = checked_rows(starts, ends, "starts", "ends")
        self._check_rows(len(p))
        alphas, normals, triangles = sweep_rows(self._scenes, p, q - p)
        return Hit(triangles >= 0, alphas, normals, triangles)  # type: ignore[arg-type]

    def _check_rows(self, n: int) -> None:
        if n % len(self.worlds):
            raise ValueError(f"expected a multiple of {len(self.worlds)} rows, as many a world, received {n}.")
