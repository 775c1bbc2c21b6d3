"""Adapter from a Gymnasium vector environment to stable-baselines3's VecEnv.

stable-baselines3 takes no Gymnasium VectorEnv, and its own DummyVecEnv steps its environments one after another on one
core.
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

from minigolf_env._validation import quote


class SB3VecEnv(VecEnv):
    """Gymnasium vector environment in SameStep mode as a VecEnv.

    Args:
        envs: vector environment; the adapter owns it and closes it.

    Raises:
        ValueError: it has another autoreset mode, which would mix transitions of two episodes.
    """

    def __init__(self, envs: gym.vector.VectorEnv[Any, Any, Any]) -> None:
        mode = envs.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"envs: expected autoreset_mode='SameStep', received {mode}; pass it to gym.make_vec.")
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> VecEnvObs:
        """Start new episodes with what ``seed`` and ``set_options`` stored; return the observations (N, ...).

        Raises:
            ValueError: the options are not those of the vector environment's reset, or some environments have other
                keys than the rest.
        """
        seeds: Any = None if self._seeds == [None] * self.num_envs else list(self._seeds)
        observations, infos = self.envs.reset(seed=seeds, options=self._batch_options())
        self.reset_infos = _split_infos(infos, np.arange(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return np.asarray(observations)

    def _batch_options(self) -> dict[str, list[Any]]:
        """Return the options of all environments as one dict, with a list of N values for each key."""
        keys = self._options[0].keys()
        if len(self._options) != self.num_envs or any(options.keys() != keys for options in self._options):
            raise ValueError(
                f"options: expected the same keys for each of {self.num_envs} environments, "
                f"received {quote(self._options)}."
            )
        return {key: [options[key] for options in self._options] for key in keys}

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (N, ...) for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step all environments; return new arrays, and an info dict each, which is empty unless an episode ended."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        dones = terminated | truncated
        info_list: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            rows = np.flatnonzero(dones)
            final_infos = _split_infos(infos["final_info"], rows)
            is_truncated = (truncated & ~terminated)[rows].tolist()
            columns = zip(rows.tolist(), final_infos, infos["final_obs"][rows], is_truncated, strict=True)
            for i, info, observation, truncation in columns:
                info_list[i] = info | {"terminal_observation": observation, "TimeLimit.truncated": truncation}
        return np.asarray(observations), rewards.astype(np.float32), dones, info_list

    def close(self) -> None:
        """Close the vector environment."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the selected environments; MiniGolfVectorEnv.get_attr lists the attributes."""
        values = self.envs.unwrapped.get_attr(attr_name)  # type: ignore[attr-defined] # Gymnasium's base class has none.
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the selected environments to one value; see MiniGolfVectorEnv.set_attr."""
        values = self.get_attr(attr_name)
        for i in self._get_indices(indices):
            values[i] = value
        self.envs.unwrapped.set_attr(attr_name, values)  # type: ignore[attr-defined]

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of all environments, return the results of the selected ones; see MiniGolfVectorEnv.call."""
        values = self.envs.unwrapped.call(method_name, *args, **kwargs)  # type: ignore[attr-defined]
        return [values[i] for i in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return False for each selected environment: a vector environment has no wrappers around the single ones."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return an image of each environment, or None without render_mode="rgb_array"."""
        images: Any = self.envs.render() if self.envs.render_mode == "rgb_array" else None
        return [None] * self.num_envs if images is None else list(images)


def _split_infos(infos: dict[str, Any], rows: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return the info dicts of some of the environments, with plain Python values."""
    columns = {key: values[rows].tolist() for key, values in infos.items() if key[0] != "_"}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
