"""The Gymnasium environments and the rules of the game they share."""

from minigolf_env.envs.levels import in_turn
from minigolf_env.envs.minigolf import MiniGolfEnv
from minigolf_env.envs.minigolf_vector import MiniGolfVectorEnv
from minigolf_env.envs.task import Outcome, Result, Task

__all__ = ["MiniGolfEnv", "MiniGolfVectorEnv", "Outcome", "Result", "Task", "in_turn"]
