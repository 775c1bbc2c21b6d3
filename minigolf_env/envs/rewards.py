"""Rewards: a table of the registered ones, and the checks of a reward function that a user passes.

A reward is a function ``reward(before, outcome, ended, task)`` of one stroke of N balls that returns N rewards:

- ``before`` (N, 3): where the balls were struck, m;
- ``outcome``: the ``Outcome`` of the strokes: ``position``, ``result``, ``holed``, ``time`` and ``bounces``;
- ``ended`` (N,), bool: the episode ended with this stroke;
- ``task``: the rules and holes of the N balls, a ``TaskBatch``; ``task.distance_to_cup(before)`` is (N,), m.

A single environment is the case N = 1. To add a reward, write its function here and add it to ``REWARDS``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray

from minigolf_env._validation import finite_array, one_of, quote
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.task import Outcome, TaskBatch

MIN_STROKES_TO_FINISH = 1.0
"""Strokes still needed next to the cup, as the shaped reward estimates them."""

STROKES_PER_METRE = 0.3
"""Further strokes still needed for each metre along the course to the cup, as the shaped reward estimates them."""

RewardFunction = Callable[[FloatArray, Outcome, NDArray[np.bool_], TaskBatch], ArrayLike]


def strokes_reward(before: FloatArray, outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> FloatArray:
    """Return -1 for each stroke, so that the return of an episode is minus its score."""
    return np.full(len(before), -1.0)


def shaped_reward(before: FloatArray, outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> FloatArray:
    """Return -1 plus the change of ``shaping_potential``, which is zero once the episode has ended.

    This is potential-based reward shaping (Ng, Harada and Russell, 1999) without a discount: over an episode it adds a
    constant, so that the best policy stays the same.
    """
    moves = np.concatenate((before, outcome.position), axis=1).reshape(-1, 2, 3)  # One call takes 3 us less than two.
    potentials = shaping_potential(task, moves)
    return np.where(ended, 0.0, potentials[:, 1]) - 1.0 - potentials[:, 0]


def shaping_potential(task: TaskBatch, positions: FloatArray) -> FloatArray:
    """Return the potential (...) of balls at positions (..., 3): minus an estimate of the strokes still needed."""
    return -(MIN_STROKES_TO_FINISH + STROKES_PER_METRE * task.distance_to_cup(positions))


REWARDS: dict[str, RewardFunction] = {"strokes": strokes_reward, "shaped": shaped_reward}
"""The registered rewards by name."""


@dataclass(frozen=True)
class CheckedReward:
    """A user's reward function whose result is checked at every call.

    The function gets read-only arrays, so that it cannot change the environment's state. Pickling needs a function that
    pickle finds by its name: one defined at the top level of a module, not a lambda.

    Args:
        function: the user's function.
    """

    function: RewardFunction

    def __call__(self, before: FloatArray, outcome: Outcome, ended: NDArray[np.bool_], task: TaskBatch) -> FloatArray:
        """Return the rewards (N,) as a new float64 array.

        Raises:
            ValueError: the function returned another shape, or a number that is not finite.
        """
        if len(before) == 0:  # Every environment of a batch is reset in this step.
            return np.zeros(0)
        views = Outcome(*(_read_only(field) for field in outcome))
        rewards = self.function(_read_only(before), views, _read_only(ended), task)
        name = f"reward {quote(_function_name(self.function))}"
        hint = "a reward function returns an array with one finite number for each ball."
        return finite_array(rewards, (len(before),), name, hint)


def build_reward(reward: str | RewardFunction) -> RewardFunction:
    """Return the function of a reward: the registered one of a name, or a user's function with checks.

    Raises:
        ValueError: no reward has this name.
    """
    if not isinstance(reward, str) and callable(reward):
        return CheckedReward(reward)
    return REWARDS[one_of(reward, tuple(REWARDS), "reward (or a function)")]


class FunctionRewardSpec(EnvSpec):
    """The spec of an environment whose reward is a function, which JSON cannot hold."""

    def to_json(self) -> str:
        """Raise a ValueError that says how to get a spec that can be written as JSON."""
        name = _function_name(self.kwargs["reward"])
        raise ValueError(
            f"spec: expected a reward by its name, one of {', '.join(map(repr, REWARDS))}, received the function "
            f"{quote(name)}, which JSON cannot hold; add it to REWARDS in minigolf_env/envs/rewards.py and give its "
            "name."
        )


def explain_unserializable(spec: EnvSpec | None) -> EnvSpec | None:
    """Return the spec of an environment; if its reward is a function, as a ``FunctionRewardSpec``."""
    if spec is None or not callable(spec.kwargs.get("reward")):
        return spec
    fields = {field.name: getattr(spec, field.name) for field in dataclasses.fields(spec) if field.init}
    return FunctionRewardSpec(**fields)


def _function_name(function: RewardFunction) -> str:
    return str(getattr(function, "__name__", type(function).__name__))


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    view = array.view()
    view.flags.writeable = False
    return view
