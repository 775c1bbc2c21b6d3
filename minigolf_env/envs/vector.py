"""A batch of MiniGolf-v0 environments that simulate their putts together, on all cores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from minigolf_env._validation import count_axes, integer, quote
from minigolf_env.courses import Course
from minigolf_env.envs.config import (
    EnvOptions,
    build_env_config,
    check_actions,
    check_autoreset,
    check_mask,
    check_options,
    one_per_env,
)
from minigolf_env.envs.episode_state import check_episode_positions, decode_state, encode_state, error_context
from minigolf_env.envs.generators import check_generators, seed_generators
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.infos import LastStrokes, batch_info, final_info
from minigolf_env.envs.rewards import explain_unserializable
from minigolf_env.envs.rules import NUM_STATE_FEATURES
from minigolf_env.envs.spaces import batch_box
from minigolf_env.envs.stroke import play_stroke
from minigolf_env.envs.task import Outcome, Task, TaskBatch, action_space, stack_tasks
from minigolf_env.rendering import RENDER_FPS, EpisodeRenderer, PuttScene

Observations = NDArray[Any]
Actions = NDArray[np.float32]
Flags = NDArray[np.bool_]
Rows = NDArray[np.int64]

ALL_ROWS = slice(None)
"""Rows of all environments: numpy indexes with a slice in a third of the time that an array of all indices takes."""

UNKNOWN_SEED = -1
"""Seed of a generator that was set from outside, as in Gymnasium."""

SHARED_ATTRIBUTES = {"action_space": "single_action_space", "observation_space": "single_observation_space"} | {
    name: name for name in ("metadata", "render_mode", "spec")
}
"""Attributes that all environments share, with their names in the batch."""


class MiniGolfVectorEnv(gym.vector.VectorEnv[Observations, Actions, NDArray[Any]]):
    """N environments of MiniGolf-v0 as one vector environment, from ``gym.make_vec("MiniGolf-v0", num_envs=N)``.

    Spaces, rewards and infos are those of MiniGolfEnv with a leading axis (N,). Environment i gives the same bits as a
    single environment seeded with seed + i, whatever N and the number of threads. Every returned array is new. With
    course="procedural" each environment plays its own level, all by the same compiled kernels; with course="round" each
    plays its own round.

    Args:
        num_envs: N >= 1.
        course: as for MiniGolfEnv.
        render_mode: None; "rgb_array": ``render()`` returns a tuple of N images; "rgb_array_list": a tuple of N
            lists of images.
        autoreset_mode: "NextStep" (the step after an episode's last one resets it and ignores the action), "SameStep"
            (the last step resets at once; the end of the episode is in info's "final_obs" and "final_info") or
            "Disabled" (call ``reset(options={"reset_mask": mask})``).
        options: the other arguments of MiniGolfEnv.

    Raises:
        ValueError: an argument or action has a wrong value; nothing has changed then.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (the base class types it so)
        "render_modes": ["rgb_array", "rgb_array_list"],
        "render_fps": RENDER_FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    renderers: tuple[EpisodeRenderer, ...] = ()
    """One for each environment if there is a render mode; none if the constructor raised an error."""
    _spec: EnvSpec | None = None

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
        config = build_env_config(course, self.metadata["render_modes"], render_mode, **options)
        self._sampler = config.sampler
        self._observation = config.observation
        self._reward = config.reward
        self.render_mode = render_mode
        self.num_envs = num_envs
        self.autoreset_mode = check_autoreset(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        # Make the spaces and, with a render mode, a renderer for each environment.
        self.single_action_space = action_space()
        self.single_observation_space = self._observation.space()
        self.action_space = batch_box(self.single_action_space, num_envs)
        self.observation_space = batch_box(self.single_observation_space, num_envs)
        task = self._sampler.default()
        num_renderers = num_envs if render_mode is not None else 0
        scene = PuttScene(task.course, task.simulate_path)
        self.renderers = tuple(EpisodeRenderer(scene, config.render_settings) for _ in range(num_renderers))
        # Make the state of the episodes, arrays (N,) and (N, 3). There are no generators before the first reset.
        self.task_batch: TaskBatch = task
        self._tasks: NDArray[np.object_] = np.full(num_envs, task, dtype=object)
        self._course_names: NDArray[np.object_] = np.full(num_envs, task.course.name, dtype=object)
        self._rngs: NDArray[np.object_] = np.empty(0, dtype=object)
        self._seeds: tuple[int, ...] = ()
        self._positions = np.empty((num_envs, 3))
        self._state = np.empty((num_envs, NUM_STATE_FEATURES), np.float32)
        self._strokes = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, np.bool_)

    @property
    def spec(self) -> EnvSpec | None:
        """The spec that ``gym.make_vec`` sets."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = explain_unserializable(spec)

    @property
    def np_random(self) -> Any:
        """The generators of the environments, a tuple of N, as of Gymnasium's SyncVectorEnv."""
        return self.get_attr("np_random")

    @np_random.setter
    def np_random(self, values: Any) -> None:
        self.set_attr("np_random", values)

    @property
    def np_random_seed(self) -> Any:
        """The seeds of the environments' generators, a tuple of N; -1 of a generator that was set from outside."""
        return self.get_attr("np_random_seed")

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new episodes in all environments, or in those of ``options["reset_mask"]`` (N,), bool.

        ``options["level"]`` is the number of the level that all play, or N numbers; ``options["hole"]`` is that of the
        hole of a round.
        """
        index_name = self._sampler.index_name
        given = check_options(options, index_name, "reset_mask")
        rows = check_mask(given.get("reset_mask"), self.num_envs)
        tasks = self._select_tasks(given.get(index_name), rows)
        if len(self._rngs) == 0 and len(rows) < self.num_envs:
            raise ResetNeeded("Reset all environments before some of them.")
        # After seeding, the task follows from the generator alone, not from the previous task.
        for i in self._seed(seed, rows):
            if i not in tasks:
                tasks[i] = self._sampler.sample(self._rngs[i], None)
        self._start_episodes(rows, tasks)
        return self._observe(ALL_ROWS), self._info(LastStrokes.none(self.num_envs), rows)

    def step(self, actions: ArrayLike) -> tuple[Observations, FloatArray, Flags, Flags, dict[str, Any]]:
        """Play one putt in every environment; return (observations, rewards, terminated, truncated, infos)."""
        self._require_reset()
        putts = check_actions(actions, (self.num_envs, 2))
        # Select the environments that play; those whose episode is over are reset instead.
        idle = np.flatnonzero(self._over)
        if self.autoreset_mode == AutoresetMode.DISABLED and len(idle):
            over = quote(idle.tolist())
            raise ResetNeeded(f"Episodes {over} are over; reset them with options={{'reset_mask': ...}}.")
        rows = np.flatnonzero(~self._over) if len(idle) else ALL_ROWS
        # Play the strokes, then advance the episodes: an error before this leaves them as they were.
        before = self._positions[rows].copy()
        stroke = play_stroke(
            self._subset(rows), self._reward, before, putts[rows], self._strokes[rows], self._rngs[rows]
        )
        self._positions[rows] = stroke.outcome.position
        self._state[rows] = stroke.state
        self._strokes[rows] += 1
        self._over[rows] = stroke.ended
        if self.renderers:
            played = zip(np.arange(self.num_envs)[rows], before, stroke.velocity, stroke.outcome.position, strict=True)
            for i, start, velocity, end in played:
                self.renderers[i].add_putt(start, velocity, end)
        # Fill in the results; idle environments have reward 0.
        rewards = np.zeros(self.num_envs)
        rewards[rows] = stroke.reward
        terminated = np.zeros(self.num_envs, np.bool_)
        terminated[rows] = stroke.ended
        truncated = np.zeros(self.num_envs, np.bool_)
        last = LastStrokes.none(self.num_envs)
        last.record(rows, stroke.outcome)
        # Reset the environments whose episode was over before this step, and observe.
        self._start_episodes(idle, {})
        observations = self._observe(ALL_ROWS)
        info = self._info(last)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and terminated.any():
            observations, info = self._autoreset(terminated, observations, info, last)
        return observations, rewards, terminated, truncated, info

    def render(self) -> tuple[Any, ...] | None:
        """Return a tuple of one image or list of images for each environment; None without a render mode."""
        self._require_reset()
        return tuple(renderer.render() for renderer in self.renderers) or None

    def close_extras(self, **kwargs: Any) -> None:
        """Close the renderers; recorders receive no more frames."""
        for renderer in self.renderers:
            renderer.close()

    def what_if(self, actions: ArrayLike) -> Outcome:
        """Return the outcomes of putts from the present states, without noise and without moving a ball.

        Args:
            actions: (N, M, 2), M putts for each environment, or (M, 2), the same for all.

        Returns:
            An Outcome of N environments and M putts: its fields have the leading shape (N, M).
        """
        self._require_reset()
        leading_shape = () if count_axes(actions) == 2 else (self.num_envs,)
        putts = check_actions(actions, (*leading_shape, None, 2))
        putts = np.broadcast_to(putts, (self.num_envs, *putts.shape[-2:]))
        positions = np.repeat(self._positions, putts.shape[1], axis=0)
        return self.task_batch.play(positions, putts.reshape(-1, 2)).outcome.reshape(*putts.shape[:2])

    def get_state(self) -> list[dict[str, Any]]:
        """Return the states of the N episodes; each can be set in a single environment, too."""
        self._require_reset()
        strokes = self._strokes.tolist()
        over = self._over.tolist()
        episodes = zip(self._tasks, self._positions, strokes, over, self._rngs, strict=True)
        return [encode_state(self._sampler, *episode) for episode in episodes]

    def set_state(self, states: Sequence[dict[str, Any]]) -> None:
        """Resume N episodes from states of single environments or of a batch, as MiniGolfEnv.set_state takes them.

        Raises:
            ValueError: the number of states is not N, a value is wrong, or an episode is over and the autoreset mode
                is "SameStep", in which episodes that end are reset at once; nothing has changed then.
        """
        episodes = []
        for i, state in enumerate(one_per_env(states, self.num_envs, "states")):
            with error_context(i):
                episodes.append(decode_state(state, self._sampler, self._tasks[i]))
                if episodes[i].over and self.autoreset_mode == AutoresetMode.SAME_STEP:
                    raise ValueError("over: expected an episode that is not over, as with autoreset 'SameStep'.")
        check_episode_positions(episodes)
        if len(self._rngs) == 0:
            self._seed(None, np.arange(self.num_envs))
        rows = np.arange(self.num_envs)
        self._assign_tasks(rows, [episode.task for episode in episodes])
        self._positions[:] = [episode.position for episode in episodes]
        self._strokes[:] = [episode.strokes for episode in episodes]
        self._over[:] = [episode.over for episode in episodes]
        self._state[:] = self.task_batch.observe_state(self._positions, self._strokes)
        for rng, episode in zip(self._rngs, episodes, strict=True):
            if episode.np_random is not None:
                rng.bit_generator.state = episode.np_random
        self._show_balls(rows)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return the result of a method of MiniGolfEnv, or an attribute, for each environment.

        Args:
            name: "get_state", "render", "what_if", or a name that ``get_attr`` takes.
            args: arguments of the method, the same for each environment.
            kwargs: keyword arguments of the method.

        Raises:
            AttributeError: the name is unknown, or the method would move single environments of the batch.
        """
        if name == "what_if":
            return tuple(Outcome(*fields) for fields in zip(*self.what_if(*args, **kwargs), strict=True))
        if name == "get_state":
            return tuple(self.get_state(*args, **kwargs))
        if name == "render":
            return self.render(*args, **kwargs) or (None,) * self.num_envs
        return self.get_attr(name)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment.

        Args:
            name: "np_random", "np_random_seed" or "task", of which each environment has its own, or "action_space",
                "metadata", "observation_space", "render_mode" or "spec", which they share.

        Raises:
            AttributeError: the name is unknown.
        """
        if name in SHARED_ATTRIBUTES:
            return (getattr(self, SHARED_ATTRIBUTES[name]),) * self.num_envs
        if name == "task":
            return tuple(self._tasks)
        if name == "np_random":
            self._require_reset()
            return tuple(self._rngs)
        if name == "np_random_seed":
            self._require_reset()
            return self._seeds
        known = ", ".join(map(repr, sorted([*SHARED_ATTRIBUTES, "np_random", "np_random_seed", "task"])))
        raise AttributeError(
            f"name: expected one of {known}, or to call 'get_state', 'render' or 'what_if', received {quote(name)}; "
            "to move the balls, call the vector environment's own reset, step or set_state, which act on all of them."
        )

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment: "np_random", to N generators.

        Raises:
            AttributeError: another name: all else is shared, or follows from the rules.
            ValueError: the values are not N different generators such as ``gymnasium.utils.seeding.np_random`` makes.
        """
        if name != "np_random":
            raise AttributeError(
                f"name: expected 'np_random', received {quote(name)}; make a new batch for other options."
            )
        self._require_reset()
        rngs = check_generators(values, self.num_envs)
        is_new = [rng is not old for rng, old in zip(rngs, self._rngs, strict=True)]
        self._seeds = tuple(UNKNOWN_SEED if new else seed for new, seed in zip(is_new, self._seeds, strict=True))
        self._rngs = rngs

    def _require_reset(self) -> None:
        if len(self._rngs) == 0:
            raise ResetNeeded("Call reset() first: there are no balls on the course yet.")

    def _autoreset(
        self, ended: Flags, observations: Observations, info: dict[str, Any], last: LastStrokes
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new episodes where one ended; return observations and info, with the end of the old ones in info."""
        rows = np.flatnonzero(ended)
        final = final_info(ended, observations, info)
        self._start_episodes(rows, {}, keep_last=True)
        observations = observations.copy()
        observations[rows] = self._observe(rows)
        last.clear(rows)
        return observations, self._info(last) | final

    def _seed(self, seed: int | Sequence[int | None] | None, rows: Rows) -> list[int]:
        """Seed the generators of some environments, or all if there are none yet; return which were seeded."""
        self._rngs, seeds = seed_generators(self._rngs, seed, rows, self.num_envs)
        self._seeds = tuple(seeds.get(i, self._seeds[i] if self._seeds else 0) for i in range(self.num_envs))
        return list(seeds)

    def _select_tasks(self, index: Any, rows: Rows) -> dict[int, Task]:
        """Return the tasks of chosen levels or holes by environment; an empty dict if none is chosen."""
        if index is None:
            return {}
        is_shared = count_axes(index) == 0
        indices = [index] * self.num_envs if is_shared else one_per_env(index, self.num_envs, self._sampler.index_name)
        return {i: self._sampler.get(indices[i]) for i in rows.tolist()}

    def _start_episodes(self, rows: Rows, tasks: dict[int, Task], keep_last: bool = False) -> None:
        """Start episodes in some environments, each on its task of ``tasks`` or on one that is sampled.

        ``keep_last`` is passed on to ``_show_balls``.
        """
        if len(rows) == 0:
            return
        rngs = self._rngs[rows]
        if self._sampler.is_indexed:
            pairs = zip(rows.tolist(), rngs, strict=True)
            self._assign_tasks(rows, [tasks.get(i) or self._sampler.sample(rng, self._tasks[i]) for i, rng in pairs])
        self._positions[rows] = self._subset(rows).sample_start(rngs)
        self._strokes[rows] = 0
        self._over[rows] = False
        self._state[rows] = self._subset(rows).observe_state(self._positions[rows], self._strokes[rows])
        self._show_balls(rows, keep_last)

    def _assign_tasks(self, rows: Rows, tasks: Sequence[Task]) -> None:
        """Set the tasks of some environments."""
        if self._sampler.is_indexed:
            self._tasks[rows] = tasks
            self._course_names[rows] = [task.course.name for task in tasks]
            self.task_batch = stack_tasks(self._tasks.tolist())

    def _subset(self, rows: Rows | slice) -> TaskBatch:
        """Return the tasks of some environments; of none, those of all."""
        if isinstance(rows, slice) or len(rows) in (0, self.num_envs):
            return self.task_batch
        return self.task_batch.take(rows)

    def _show_balls(self, rows: Rows, keep_last: bool = False) -> None:
        """Show the balls of some environments, which were placed without a putt, on their courses.

        With ``keep_last`` the last putt, if not yet rendered, is still shown before; otherwise it is dropped.
        """
        for i in rows.tolist() if self.renderers else ():
            task = self._tasks[i]
            scene = PuttScene(task.course, task.simulate_path)
            self.renderers[i].place_ball(self._positions[i].copy(), scene, keep_last)

    def _observe(self, rows: Rows | slice) -> Observations:
        return self._observation.observe(
            self._subset(rows), self._positions[rows], self._strokes[rows], self._state[rows]
        )

    def _info(self, last: LastStrokes, rows: Rows | slice = ALL_ROWS) -> dict[str, Any]:
        index: dict[str, NDArray[np.int64]] = {}
        if self._sampler.is_indexed:
            index[self._sampler.index_name] = np.array([task.index for task in self._tasks], dtype=np.int64)
        return batch_info(self._strokes, last, self._course_names, index, rows)
