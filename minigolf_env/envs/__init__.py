"""The Gymnasium environments and the rules of the game they share."""

from minigolf_env.envs.minigolf import MiniGolfEnv
from minigolf_env.envs.samplers import round_reset_options
from minigolf_env.envs.task import Outcome, Result, Task
from minigolf_env.envs.vector import MiniGolfVectorEnv

__all__ = ["MiniGolfEnv", "MiniGolfVectorEnv", "Outcome", "Result", "Task", "round_reset_options"]
