"""A batch of MiniGolf-v0 environments that play their putts together, on all cores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from minigolf_env._validation import integer
from minigolf_env.courses import Course
from minigolf_env.envs.attributes import Attributes, Observations
from minigolf_env.envs.config import (
    EnvOptions,
    build_env_config,
    check_actions,
    check_autoreset,
    check_mask,
    check_options,
    one_each,
)
from minigolf_env.envs.episode_state import check_episode_positions, decode_state, encode_state, error_context
from minigolf_env.envs.task import FloatArray, Outcome, Result, Task, TaskBatch, action_space, stack_tasks, take
from minigolf_env.rendering import RENDER_FPS, EpisodeRenderer, RenderContext

Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]

ALL = slice(None)
"""In place of the rows of all environments: numpy takes a third of the time."""

TEE = -1
"""Stands for "tee" where other strokes have a Result."""

STATUS = np.array([*(result.name.lower() for result in Result), "tee"], dtype=object)
"""The names in info's "status" of each Result, and last of TEE."""


class MiniGolfVectorEnv(Attributes):
    """N environments of MiniGolf-v0 as one, through ``gym.make_vec("MiniGolf-v0", num_envs=N)``.

    Spaces, rewards and infos are MiniGolfEnv's with a leading axis (N,). Environment i gives the same bits as a single
    environment seeded with seed + i, whatever N and the number of threads. Every array returned is new. With
    course="procedural" each environment plays a level of its own, all by the same compiled kernels, with course="round"
    a round of its own.

    Args:
        num_envs: N >= 1.
        course: as for MiniGolfEnv.
        render_mode: None; "rgb_array": ``render()`` returns a tuple of N pictures; "rgb_array_list": N lists of them.
        autoreset_mode: "NextStep" (the step after an episode's last resets it and ignores the action), "SameStep" (the
            last step resets at once; the end is in info's "final_obs" and "final_info") or "Disabled" (call
            ``reset(options={"reset_mask": mask})``).
        options: the other arguments of MiniGolfEnv.

    Raises:
        ValueError: an argument or action is not what it should be; nothing has changed then.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (the base class types it so)
        "render_modes": ["rgb_array", "rgb_array_list"],
        "render_fps": RENDER_FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    renderers: tuple[EpisodeRenderer, ...] = ()
    """One for each environment that can be seen; none where the constructor was refused its arguments."""

    def __init__(
        self,
        num_envs: int = 1,
        course: str | Course = "dogleg",
        render_mode: str | None = None,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **options: Unpack[EnvOptions],
    ) -> None:
        num_envs = integer(num_envs, "num_envs", 1)
        self._sampler, self._observer, settings = build_env_config(
            course, self.metadata["render_modes"], render_mode, **options
        )
        self.render_mode = render_mode
        self.num_envs = num_envs
        self.autoreset_mode = check_autoreset(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        first = self._sampler.default()
        num_renderers = num_envs if render_mode is not None else 0
        context = RenderContext(first.course, first.simulate_path)
        self.renderers = tuple(EpisodeRenderer(context, settings) for _ in range(num_renderers))
        self.single_action_space, self.single_observation_space = action_space(), self._observer.space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs: NDArray[np.object_] = np.empty(0, dtype=object)
        self._all: Rows = np.arange(num_envs)
        self._tasks = np.full(num_envs, first, dtype=object)
        self._course_names = np.full(num_envs, first.course.name, dtype=object)
        self.task_batch: TaskBatch = first
        self._positions = np.empty((num_envs, 3))
        self._potentials = np.empty(num_envs)
        self._strokes = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new episodes in all environments, or in those of ``options["reset_mask"]`` (N,), bool.

        ``options["level"]`` is the number of the level that all play, or N numbers; of a round, ``options["hole"]``.
        """
        key = self._sampler.index_name
        given = check_options(options, key, "reset_mask")
        rows = check_mask(given.get("reset_mask"), self.num_envs)
        holes = self._select_tasks(given.get(key), rows)
        if len(self._rngs) == 0 and len(rows) < self.num_envs:
            raise ResetNeeded("Reset all environments before some of them.")
        for i in self._seed(seed, rows):
            holes[i] = holes.get(i) or self._sampler.sample(self._rngs[i], None)
        self._start_episodes(rows, holes)
        return self._observe(ALL), self._info(self._no_strokes())

    def step(self, actions: ArrayLike) -> tuple[Observations, FloatArray, Flags, Flags, dict[str, Any]]:
        """Play one putt in every environment; return (observations, rewards, terminated, truncated, infos)."""
        self._require_balls()
        putts = check_actions(actions, (self.num_envs, 2))
        idle = np.flatnonzero(self._over)
        if self.autoreset_mode == AutoresetMode.DISABLED and len(idle):
            raise ResetNeeded(f"Episodes {idle.tolist()} are over; reset them with options={{'reset_mask': ...}}.")
        rows = np.flatnonzero(~self._over) if len(idle) else ALL
        game, before = self._subset(rows), self._positions[rows].copy()
        velocities = game.launch_velocity(putts[rows], game.sample_noise(self._rngs[rows]) if game.is_noisy else None)
        outcome = game.simulate(before, velocities)
        self._positions[rows] = outcome.position
        self._strokes[rows] += 1
        if self.renderers:
            for i, *putt in zip(self._all[rows], before, velocities, outcome.position, strict=True):
                self.renderers[i].add_putt(*putt)
        over = outcome.holed | (self._strokes[rows] >= game.max_strokes)
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, np.bool_)
        potentials = game.potential(outcome.position)
        rewards[rows], terminated[rows] = game.rewards(self._potentials[rows], potentials, over), over
        self._potentials[rows] = potentials
        last = self._no_strokes()
        for field, value in zip(last, outcome[1:], strict=True):
            field[rows] = value
        self._over[rows] = over
        self._start_episodes(idle, {})
        observations, info = self._observe(ALL), self._info(last)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and over.any():
            observations, info = self._autoreset(terminated, observations, info, last)
        return observations, rewards, terminated, np.zeros(self.num_envs, np.bool_), info

    def render(self) -> tuple[Any, ...] | None:
        """Return what the render mode promises, of each environment; None without one."""
        self._require_balls()
        return tuple(renderer.render() for renderer in self.renderers) or None

    def what_if(self, actions: ArrayLike) -> Outcome:
        """Return what putts from the present states would lead to, without noise and without moving a ball.

        Args:
            actions: (N, M, 2), M putts for each environment, or (M, 2), the same for all.

        Returns:
            An Outcome of N environments and M putts: its fields have the leading shape (N, M).
        """
        self._require_balls()
        each = () if np.ndim(actions) == 2 else (self.num_envs,)
        putts = check_actions(actions, (*each, None, 2))
        putts = np.broadcast_to(putts, (self.num_envs, *putts.shape[-2:]))
        rows = np.repeat(self._all, putts.shape[1])
        game = take(self.task_batch, rows)
        outcome = game.simulate(self._positions[rows], game.launch_velocity(putts.reshape(-1, 2)))
        return outcome.reshape(*putts.shape[:2])

    def get_state(self) -> list[dict[str, Any]]:
        """Return the states of the N episodes, each as MiniGolfEnv.get_state returns it: it fits one there, too."""
        self._require_balls()
        strokes, over = self._strokes.tolist(), self._over.tolist()
        episodes = zip(self._tasks, self._positions, strokes, over, self._rngs, strict=True)
        return [encode_state(self._sampler, *episode) for episode in episodes]

    def set_state(self, states: Sequence[dict[str, Any]]) -> None:
        """Go on from N states of single environments, or of a batch; what MiniGolfEnv.set_state takes is taken here.

        Raises:
            ValueError: there are not N, one is not what it should be, or an episode is over though the autoreset mode
                is "SameStep", where none stays so; nothing has changed then.
        """
        episodes = []
        for i, state in enumerate(one_each(states, self.num_envs, "states")):
            with error_context(i):
                episodes.append(decode_state(state, self._sampler, self._tasks[i]))
                if episodes[i].over and self.autoreset_mode == AutoresetMode.SAME_STEP:
                    raise ValueError("over: expected an episode that goes on, as autoreset 'SameStep' has them all.")
        check_episode_positions(episodes)
        if len(self._rngs) == 0:
            self._seed(None, self._all)
        holes, positions, self._strokes[:], self._over[:], randoms = zip(*episodes, strict=True)
        self._positions[:] = positions
        self._assign_tasks(self._all, holes)
        for rng, random in zip(self._rngs, randoms, strict=True):
            if random is not None:
                rng.bit_generator.state = random
        self._place_balls(self._all)

    def _autoreset(
        self, ended: Flags, observations: Observations, info: dict[str, Any], last: tuple[NDArray[Any], ...]
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin new episodes where one ended; return observations and info, with the old ones' end in it."""
        rows = np.flatnonzero(ended)
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in rows.tolist():
            final_obs[i] = observations[i]
        final_info = {key: ended.copy() if key.startswith("_") else value for key, value in info.items()}
        self._start_episodes(rows, {}, keep_last=True)
        observations = observations.copy()
        observations[rows] = self._observe(rows)
        for field, value in zip(last, (TEE, 0.0, 0), strict=True):
            field[rows] = value
        begun = self._info(last)
        ends = {"final_obs": final_obs, "final_info": final_info}
        return observations, begun | ends | {f"_{key}": ended.copy() for key in ends}

    def _seed(self, seed: int | Sequence[int | None] | None, rows: Rows) -> list[int]:
        """Seed the generators of some environments, or all if there are none yet; return which were."""
        if seed is None or isinstance(seed, (int, np.integer)):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = one_each(seed, self.num_envs, "seed")
        fresh = len(self._rngs) == 0
        rngs = np.full(self.num_envs, None, dtype=object) if fresh else self._rngs.copy()
        seeded = [i for i in rows.tolist() if fresh or seeds[i] is not None]
        for i in seeded:
            rngs[i], _ = gym.utils.seeding.np_random(seeds[i])
        self._rngs = rngs
        return seeded

    def _select_tasks(self, level: Any, rows: Rows) -> dict[int, Task]:
        """Return the holes of chosen levels, by environment; none where no level is."""
        if level is None:
            return {}
        name = self._sampler.index_name
        levels = [level] * self.num_envs if np.ndim(level) == 0 else one_each(level, self.num_envs, name)
        return {i: self._sampler.get(levels[i]) for i in rows.tolist()}

    def _start_episodes(self, rows: Rows, holes: dict[int, Task], keep_last: bool = False) -> None:
        """Begin episodes in some environments, each on its hole of ``holes``, or on one that is drawn."""
        if len(rows) == 0:
            return
        rngs = self._rngs[rows]
        if self._sampler.is_indexed:
            draw, last = self._sampler.sample, self._tasks
            chosen = (holes.get(i) or draw(rng, last[i]) for i, rng in zip(rows.tolist(), rngs, strict=True))
            self._assign_tasks(rows, list(chosen))
        self._positions[rows] = self._subset(rows).sample_start(rngs)
        self._strokes[rows], self._over[rows] = 0, False
        self._place_balls(rows, keep_last)

    def _assign_tasks(self, rows: Rows, holes: Sequence[Task]) -> None:
        """Let some environments play on these holes."""
        if self._sampler.is_indexed:
            self._tasks[rows] = holes
            self._course_names[rows] = [hole.course.name for hole in holes]
            self.task_batch = stack_tasks(self._tasks.tolist())

    def _subset(self, rows: Rows | slice) -> TaskBatch:
        if isinstance(rows, slice) or len(rows) == self.num_envs:
            return self.task_batch
        return take(self.task_batch, rows)

    def _place_balls(self, rows: Rows, keep_last: bool = False) -> None:
        """Take in that the balls of some environments were put where they lie now."""
        self._potentials[rows] = self._subset(rows).potential(self._positions[rows])
        for i in rows.tolist() if self.renderers else ():
            hole = self._tasks[i]
            self.renderers[i].place_ball(
                self._positions[i].copy(), RenderContext(hole.course, hole.simulate_path), keep_last
            )

    def _observe(self, rows: Rows | slice) -> Observations:
        return self._observer.observe(self._subset(rows), self._positions[rows], self._strokes[rows])

    def _no_strokes(self) -> tuple[NDArray[Any], ...]:
        """Return result, time and bounces (N,) of environments in which no stroke was played."""
        n = self.num_envs
        return np.full(n, TEE, np.int8), np.zeros(n), np.zeros(n, np.int64)

    def _info(self, last: tuple[NDArray[Any], ...]) -> dict[str, Any]:
        """Return the infos as arrays (N,), each with its mask, as Gymnasium's vector environments have it.

        ``last``: result, time and bounces of the last strokes.
        """
        result, time, bounces = last
        info: dict[str, Any] = {
            "strokes": self._strokes.copy(),
            "is_success": result == Result.HOLED,
            "status": STATUS[result],
            "shot_time": time.copy(),
            "bounces": bounces.copy(),
            "course": self._course_names.copy(),
        }
        if self._sampler.is_indexed:
            info[self._sampler.index_name] = np.array([hole.index for hole in self._tasks], dtype=np.int64)
        return info | {f"_{key}": np.ones(self.num_envs, np.bool_) for key in info}
