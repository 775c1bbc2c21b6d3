"""A user's program: it asserts the types that mypy infers, and its last lines must be type errors."""

from __future__ import annotations

from typing import Any, assert_type

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import minigolf_env
from minigolf_env.courses import Course, load_course
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv, Outcome
from minigolf_env.physics import Hit, Shot, Surface, TriangleMesh, World
from minigolf_env.players.search import Plan, search

made = gym.make("MiniGolf-v0", course="dogleg", render_mode="rgb_array")
assert_type(made, gym.Env[Any, Any])
assert isinstance(made.unwrapped, MiniGolfEnv)
assert_type(made.unwrapped.what_if([[0.5, 0.5]]), Outcome)
assert_type(search(made.unwrapped), Plan)

env = MiniGolfEnv("dogleg", observation="rays")
observation, info = env.reset(seed=1)
assert_type(observation, NDArray[Any])
observation, reward, terminated, truncated, info = env.step([0.5, 0.5])
assert_type((reward, terminated, truncated, info), tuple[float, bool, bool, dict[str, Any]])
assert_type(env.get_state(), dict[str, Any])

envs = MiniGolfVectorEnv(4)
observations, rewards, terminations, truncations, infos = envs.step(envs.action_space.sample())
assert_type(rewards, NDArray[np.float64])
assert_type(terminations, NDArray[np.bool_])

assert_type(load_course("dogleg"), Course)
assert_type(minigolf_env.load_course("dogleg"), minigolf_env.Course)
mesh = TriangleMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], surface=Surface(damping=0.7))
world = World([mesh], ball_radius=0.02, gravity=(0, 0, -9.81), dt=1 / 120)
assert_type(world.sweep(start=(0, 0, 1), end=(0, 0, -1)), Hit)
assert_type(world.simulate(position=(0, 0, 1), velocity=(1, 0, 0), max_time=1.0), Shot)
assert_type(world.simulate_batch(np.zeros((3, 3)), np.zeros((3, 3)), max_time=1.0), Shot)

env.what_if()  # type: ignore[call-arg]
MiniGolfEnv(curse="dogleg")  # type: ignore[call-arg]
World(mesh, ball_radius=0.02)  # type: ignore[arg-type]
