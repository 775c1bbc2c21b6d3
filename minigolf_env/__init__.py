"""Minigolf for reinforcement learning: importing this package registers ``MiniGolf-v0`` with Gymnasium."""

import gymnasium as gym

__all__ = ["__version__"]
__version__ = "0.1.0"

gym.register(
    id="MiniGolf-v0",
    entry_point="minigolf_env.envs:MiniGolfEnv",
    vector_entry_point="minigolf_env.envs:MiniGolfVectorEnv",
)
