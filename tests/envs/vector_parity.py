"""A batch next to single environments that play the same putts."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv


class VectorParity:
    """A batch and single environments; each call checks that environment i equals single environment i bit for bit."""

    def __init__(self, mode: str, n: int = 4, seed: int = 11, **options: Any) -> None:
        made = gym.make_vec("minigolf_env:MiniGolf-v0", num_envs=n, autoreset_mode=mode, **options)
        assert isinstance(made.unwrapped, MiniGolfVectorEnv)
        self.batch, self.mode, self.n = made.unwrapped, mode, n
        self.singles = [MiniGolfEnv(**options) for _ in range(n)]
        self.over = np.zeros(n, np.bool_)
        observed, infos = self.batch.reset(seed=seed)
        for i, env in enumerate(self.singles):
            self._check(i, (observed, infos), env.reset(seed=seed + i))

    def putts(self, k: int, *shape: int) -> NDArray[np.float32]:
        """Return putts (n, *shape, 2)."""
        return np.random.default_rng(k).uniform(-1, 1, (self.n, *shape, 2)).astype(np.float32)

    def play(self, steps: int, first: int = 0) -> None:
        """Play random putts, through the ends of episodes."""
        for k in range(first, first + steps):
            if self.mode == "Disabled" and self.over.any():
                result = self.batch.reset(options={"reset_mask": self.over})
                for i in np.flatnonzero(self.over):
                    self._check(i, result, self.singles[i].reset())
                self.over = np.zeros(self.n, np.bool_)
            self._step(self.putts(k))

    def _step(self, putts: NDArray[np.float32]) -> None:
        observed, rewards, terminated, truncated, infos = self.batch.step(putts)
        for i, env in enumerate(self.singles):
            if self.mode == "NextStep" and self.over[i]:
                assert rewards[i] == 0.0 and not terminated[i]
                one = env.reset()
            else:
                observation, reward, ended, _, info = env.step(putts[i])
                assert (rewards[i], terminated[i], truncated[i]) == (reward, ended, False)
                one = observation, info
                if self.mode == "SameStep":
                    assert ended == bool("_final_obs" in infos and infos["_final_obs"][i])
                    if ended:
                        self._check(i, (infos["final_obs"], infos["final_info"]), one)
                        one = env.reset()
            self._check(i, (observed, infos), one)
        self.over = terminated.copy()

    def _check(self, i: int, many: tuple[Any, dict[str, Any]], one: tuple[Any, dict[str, Any]]) -> None:
        assert many[0][i].dtype == one[0].dtype and many[0][i].tobytes() == one[0].tobytes()
        assert {key: many[1][key][i] for key in one[1]} == one[1]
        assert all(many[1][f"_{key}"][i] for key in one[1])
