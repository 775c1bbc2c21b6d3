"""A batch of MiniGolf-v0 environments that play their putts together, on all cores."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses import Course
from minigolf_env.envs.options import check_actions, make_setup
from minigolf_env.envs.task import FloatArray, Game, Result, Task, action_space, of_rows, together
from minigolf_env.rendering import FPS, Screen, Stage

Observations = NDArray[Any]
Actions = NDArray[np.float32]
Flags = NDArray[np.bool_]


class MiniGolfVectorEnv(gym.vector.VectorEnv[Observations, Actions, NDArray[Any]]):
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
        "render_fps": FPS,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        course: str | Course = "dogleg",
        render_mode: str | None = None,
        *,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        if type(num_envs) is not int or num_envs < 1:
            raise ValueError(f"num_envs: expected an integer >= 1, received {num_envs!r}.")
        self._tasks, self._observer, settings = make_setup(
            course, self.metadata["render_modes"], render_mode, **options
        )
        self.render_mode = render_mode
        self.num_envs = num_envs
        self.autoreset_mode = _autoreset(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        shown = num_envs if render_mode is not None else 0
        first = self._tasks.first()
        self.screens = tuple(Screen(Stage(first.course, first.trace), settings) for _ in range(shown))
        self.single_action_space, self.single_observation_space = action_space(), self._observer.space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs: list[np.random.Generator] = []
        self._holes = [first] * num_envs
        self.game: Game = first
        self._positions = np.empty((num_envs, 3))
        self._strokes = np.zeros(num_envs, np.int64)
        self._over = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new episodes in all environments, or in those of ``options["reset_mask"]`` (N,), bool.

        ``options["level"]`` is the number of the level that all play, or N numbers; of a round, ``options["hole"]``.
        """
        given = dict(options or {})
        mask = _mask(given.pop("reset_mask", None), self.num_envs)
        key = self._tasks.key
        holes = self._chosen(given.pop(key, None), mask)
        if given:
            raise ValueError(f"options: expected only '{key}' and 'reset_mask', received {sorted(given)} as well.")
        if not self._rngs and not mask.all():
            raise ResetNeeded("Reset all environments before some of them.")
        for i in self._seed(seed, mask):
            holes[i] = holes[i] if i in holes else self._tasks.draw(self._rngs[i], None)
        self._tee_off(mask, holes)
        status = np.full(self.num_envs, "tee", dtype=object)
        return self._observe(), self._info(status, np.zeros(self.num_envs), np.zeros(self.num_envs, np.int64))

    def step(self, actions: ArrayLike) -> tuple[Observations, FloatArray, Flags, Flags, dict[str, Any]]:
        """Play one putt in every environment; return (observations, rewards, terminated, truncated, infos)."""
        if not self._rngs:
            raise ResetNeeded("Call reset() first: there are no balls on the course yet.")
        putts = check_actions(actions, (self.num_envs, 2))
        playing = ~self._over
        if self.autoreset_mode == AutoresetMode.DISABLED and not playing.all():
            raise ResetNeeded(
                f"Episodes {np.flatnonzero(~playing).tolist()} are over; reset them with options={{'reset_mask': ...}}."
            )
        rows = np.flatnonzero(playing)
        before = self._positions[rows]
        game = self.game if playing.all() else of_rows(self.game, rows)
        velocities = game.launch(putts[rows], game.disturb([self._rngs[i] for i in rows]))
        outcome = game.play(before, velocities)
        self._positions[rows] = outcome.position
        if self.screens:
            for k, i in enumerate(rows):
                self.screens[i].putt(before[k], velocities[k], outcome.position[k])
        self._strokes[rows] += 1
        over = outcome.holed | (self._strokes[rows] >= game.max_strokes)
        rewards, terminated = np.zeros(self.num_envs), np.zeros(self.num_envs, np.bool_)
        rewards[rows] = game.rewards(before, outcome.position, over)
        terminated[rows] = over

        time, bounces = np.zeros(self.num_envs), np.zeros(self.num_envs, np.int64)
        status = np.full(self.num_envs, "tee", dtype=object)
        status[rows] = STATUS[outcome.result]
        time[rows], bounces[rows] = outcome.time, outcome.bounces
        self._tee_off(~playing, {})
        self._over[rows] = over
        info = self._info(status, time, bounces)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and over.any():
            info = self._restart(terminated, info)
        return self._observe(), rewards, terminated, np.zeros(self.num_envs, np.bool_), info

    def render(self) -> tuple[Any, ...] | None:
        """Return what the render mode promises, of each environment; None without one."""
        if not self._rngs:
            raise ResetNeeded("Call reset() first: there are no balls on the course yet.")
        return tuple(screen.render() for screen in self.screens) or None

    def close_extras(self, **kwargs: Any) -> None:
        """Tell nothing more to those who film."""
        for screen in self.screens:
            screen.close()

    def _restart(self, ended: Flags, final: dict[str, Any]) -> dict[str, Any]:
        """Begin new episodes where one ended; return their info, with the old one's end in it."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        observations = self._observe()
        for i in np.flatnonzero(ended):
            final_obs[i] = observations[i]
        self._tee_off(ended, {}, keep_last=True)
        status, time, bounces = final["status"].copy(), final["shot_time"].copy(), final["bounces"].copy()
        status[ended], time[ended], bounces[ended] = "tee", 0.0, 0
        info = self._info(status, time, bounces)
        masked = {key: value for key, value in final.items() if not key.startswith("_")}
        final_info = {**masked, **{f"_{key}": ended.copy() for key in masked}}
        info |= {"final_obs": final_obs, "_final_obs": ended.copy()}
        return info | {"final_info": final_info, "_final_info": ended.copy()}

    def _seed(self, seed: int | list[int | None] | None, mask: Flags) -> list[int]:
        """Seed the environments that a mask and seeds name; return which these are."""
        if isinstance(seed, int):
            seeds: list[int | None] = [seed + i for i in range(self.num_envs)]
        else:
            seeds = [None] * self.num_envs if seed is None else list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: expected one number or {self.num_envs}, received {len(seeds)}.")
        fresh = not self._rngs
        if fresh:
            self._rngs = [np.random.Generator(np.random.PCG64(0))] * self.num_envs
        seeded = [i for i in np.flatnonzero(mask).tolist() if fresh or seeds[i] is not None]
        for i in seeded:
            self._rngs[i], _ = gym.utils.seeding.np_random(seeds[i])
        return seeded

    def _chosen(self, level: Any, mask: Flags) -> dict[int, Task]:
        """Return the holes of chosen levels, by environment; none where no level is."""
        if level is None:
            return {}
        levels = [level] * self.num_envs if np.ndim(level) == 0 else list(level)
        if len(levels) != self.num_envs:
            raise ValueError(f"{self._tasks.key}: expected one number or {self.num_envs}, received {len(levels)}.")
        return {int(i): self._tasks.level(levels[i]) for i in np.flatnonzero(mask)}

    def _tee_off(self, mask: Flags, holes: dict[int, Task], keep_last: bool = False) -> None:
        """Begin episodes, each on its hole of ``holes``, or on one that is drawn."""
        for i in np.flatnonzero(mask).tolist():
            hole = self._holes[i] = holes[i] if i in holes else self._tasks.draw(self._rngs[i], self._holes[i])
            self._positions[i] = hole.tee_off(self._rngs[i])
            if self.screens:
                self.screens[i].put(self._positions[i].copy(), Stage(hole.course, hole.trace), keep_last)
        if self._tasks.has_levels and mask.any():
            self.game = together(self._holes)
        self._strokes[mask], self._over[mask] = 0, False

    def _observe(self) -> Observations:
        return self._observer.observe(self.game, self._positions, self._strokes)

    def _info(self, status: NDArray[np.object_], time: FloatArray, bounces: NDArray[np.int64]) -> dict[str, Any]:
        """Return the infos as arrays (N,), each with its mask, as Gymnasium's vector environments have it."""
        info: dict[str, Any] = {
            "strokes": self._strokes.copy(),
            "is_success": status == "holed",
            "status": status,
            "shot_time": time,
            "bounces": bounces,
            "course": np.array([hole.course.name for hole in self._holes], dtype=object),
        }
        if self._tasks.has_levels:
            info[self._tasks.key] = np.array([hole.level for hole in self._holes], dtype=np.int64)
        return info | {f"_{key}": np.ones(self.num_envs, np.bool_) for key in info}


STATUS = np.array([result.name.lower() for result in Result], dtype=object)
"""The name of each Result in info's "status"."""


def _autoreset(mode: str | AutoresetMode) -> AutoresetMode:
    known = [m.value for m in AutoresetMode]
    if mode not in known and mode not in list(AutoresetMode):
        raise ValueError(f"autoreset_mode: expected one of {known}, received {mode!r}.")
    return AutoresetMode(mode)


def _mask(mask: Any, n: int) -> Flags:
    if mask is None:
        return np.ones(n, np.bool_)
    if not (isinstance(mask, np.ndarray) and mask.dtype == np.bool_ and mask.shape == (n,) and mask.any()):
        raise ValueError(f"reset_mask: expected a bool array of shape ({n},) with a True in it, received {mask!r:.80}.")
    return mask
