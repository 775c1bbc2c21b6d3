"""Lets an agent see "rays", and putt, as if the cup were straight ahead: minigolf_env/facing.py says how."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from minigolf_env.envs.rays import ray_space
from minigolf_env.facing import VIEW, face_cup, turn


class FacingVecEnv(VecEnvWrapper):
    """A VecEnv of "rays" observations (N, 48) as one of views (N, VIEW).

    Args:
        venv: the environments.

    Raises:
        ValueError: they show something else.
    """

    def __init__(self, venv: VecEnv) -> None:
        if venv.observation_space.shape != ray_space().shape:
            raise ValueError(
                f"facing: expected observation 'rays' {ray_space().shape}, received {venv.observation_space.shape}; "
                "leave facing out, or observe rays."
            )
        super().__init__(venv, observation_space=Box(-1.0, 1.0, (VIEW,), np.float32))
        self._ahead = np.zeros((venv.num_envs, 2), np.float32)

    def reset(self) -> VecEnvObs:
        """Start new episodes."""
        return self._look(self.venv.reset())

    def step_async(self, actions: np.ndarray) -> None:
        """Take putts (N, 2) in the frame of the last view."""
        self.venv.step_async(turn(actions, self._ahead))

    def step_wait(self) -> VecEnvStepReturn:
        """Play them."""
        observations, rewards, dones, infos = self.venv.step_wait()
        for i in np.flatnonzero(dones).tolist():
            infos[i]["terminal_observation"] = face_cup(infos[i]["terminal_observation"][None])[0][0]
        return self._look(observations), rewards, dones, infos

    def _look(self, observations: VecEnvObs) -> np.ndarray:
        view, self._ahead = face_cup(np.asarray(observations))
        return view
