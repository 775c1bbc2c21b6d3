"""Feeds stable-baselines3 the native batch: its VecEnv over a Gymnasium vector environment.

stable-baselines3 takes no Gymnasium VectorEnv, and its own DummyVecEnv plays one putt after another on one core.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
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
        self.reset_infos = [_info_of(infos, i) for i in range(self.num_envs)]
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
        for i in np.flatnonzero(dones).tolist():
            by_env[i] = _info_of(infos["final_info"], i)
            by_env[i]["terminal_observation"] = infos["final_obs"][i]
            by_env[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return _array(observations), rewards.astype(np.float32), dones, by_env

    def close(self) -> None:
        """Close the batch."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the batch once for each environment asked for."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the whole batch.

        Raises:
            ValueError: only some environments were asked for; they share their attributes.
        """
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ValueError(f"set_attr: expected all environments, received {indices}; they share their attributes.")
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of the batch and return its result once for each environment asked for."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(list(self._get_indices(indices)))

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return False for each environment: a native batch holds no wrapped ones."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return a picture of each environment; None without render_mode="rgb_array"."""
        pictures: Any = self.envs.render() if self.envs.render_mode == "rgb_array" else None
        return [None] * self.num_envs if pictures is None else list(pictures)


def _info_of(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """Return environment i's share of a batch's infos, as plain Python values where numpy has them."""
    mine = {key: value[i] for key, value in infos.items() if not key.startswith("_") and key[:5] != "final"}
    return {key: value.item() if isinstance(value, np.generic) else value for key, value in mine.items()}


def _array(observations: Any) -> np.ndarray:
    return np.asarray(observations)
