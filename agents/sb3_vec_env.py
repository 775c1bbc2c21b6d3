"""Feeds stable-baselines3 the native batch: its VecEnv over a Gymnasium vector environment.

stable-baselines3 takes no Gymnasium VectorEnv, and its own DummyVecEnv plays one putt after another on one core.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn


class SB3VecEnv(VecEnv):
    """A Gymnasium vector environment in SameStep mode as a VecEnv.

    Args:
        envs: the batch; the wrapper owns it and closes it.

    Raises:
        ValueError: the batch resets in another mode, which would mix two episodes.
    """

    def __init__(self, envs: gym.vector.VectorEnv[Any, Any, Any]) -> None:
        mode = envs.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"envs: expected autoreset_mode='SameStep', received {mode}; pass it to gym.make_vec.")
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> VecEnvObs:
        """Start new episodes, with the seeds that ``seed`` stored."""
        seeds: Any = None if self._seeds == [None] * self.num_envs else list(self._seeds)
        observations, infos = self.envs.reset(seed=seeds)
        self.reset_infos = _infos_of(infos, np.arange(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return _array(observations)

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (N, ...) for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Play them; return new arrays, and an info for each environment, filled where an episode ended."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        dones = terminated | truncated
        by_env: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            rows = np.flatnonzero(dones)
            cut = (truncated & ~terminated)[rows].tolist()
            ends = zip(rows.tolist(), _infos_of(infos["final_info"], rows), infos["final_obs"][rows], cut, strict=True)
            for i, info, seen, truncation in ends:
                by_env[i] = info | {"terminal_observation": seen, "TimeLimit.truncated": truncation}
        return _array(observations), rewards.astype(np.float32), dones, by_env

    def close(self) -> None:
        """Close the batch."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each environment asked for; MiniGolfVectorEnv.get_attr lists them."""
        values = self.envs.unwrapped.get_attr(attr_name)  # type: ignore[attr-defined] # Gymnasium's base class has none.
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of each environment asked for to one value; see MiniGolfVectorEnv.set_attr."""
        values = self.get_attr(attr_name)
        for i in self._get_indices(indices):
            values[i] = value
        self.envs.unwrapped.set_attr(attr_name, values)  # type: ignore[attr-defined]

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of all environments; return what it gives in those asked for; see MiniGolfVectorEnv.call."""
        values = self.envs.unwrapped.call(method_name, *args, **kwargs)  # type: ignore[attr-defined]
        return [values[i] for i in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return False for each environment: a native batch holds no wrapped ones."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return a picture of each environment; None without render_mode="rgb_array"."""
        pictures: Any = self.envs.render() if self.envs.render_mode == "rgb_array" else None
        return [None] * self.num_envs if pictures is None else list(pictures)


def _infos_of(infos: dict[str, Any], rows: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return some environments' shares of a batch's infos: a dict each, with plain Python values."""
    mine = {key: value[rows].tolist() for key, value in infos.items() if key[0] != "_"}
    return [dict(zip(mine, values, strict=True)) for values in zip(*mine.values(), strict=True)]


def _array(observations: Any) -> np.ndarray:
    return np.asarray(observations)
