"""What Gymnasium's vector environments offer of each of their environments, for a batch that has none apart."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from minigolf_env.envs.config import one_each
from minigolf_env.envs.task import Outcome

Observations = NDArray[Any]
Actions = NDArray[np.float32]

SHARED = {"action_space": "single_action_space", "observation_space": "single_observation_space"} | {
    name: name for name in ("metadata", "render_mode", "spec")
}
"""Attributes that all environments share, and what the batch calls them."""


class Attributes(gym.vector.VectorEnv[Observations, Actions, NDArray[Any]]):
    """A batch of MiniGolf-v0, asked for its environments one by one, as Gymnasium's SyncVectorEnv can be."""

    _rngs: NDArray[np.object_]
    """(N,) their generators; none before the first reset."""
    _tasks: NDArray[np.object_]
    """(N,) their tasks."""

    @abstractmethod
    def what_if(self, actions: ArrayLike) -> Outcome:
        """Return what putts from the present states would lead to."""

    @abstractmethod
    def get_state(self) -> list[dict[str, Any]]:
        """Return the states of the N episodes."""

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return what a method of MiniGolfEnv, or an attribute, gives in each environment.

        Args:
            name: "get_state", "render", "what_if", or what ``get_attr`` takes.
            args: of the method, the same for each environment.
            kwargs: of the method.

        Raises:
            AttributeError: there is no such name, or it would move single environments of the batch.
        """
        if name == "what_if":
            return tuple(Outcome(*fields) for fields in zip(*self.what_if(*args, **kwargs), strict=True))
        if name == "get_state":
            return tuple(self.get_state(*args, **kwargs))
        if name == "render":
            return self.render(*args, **kwargs) or (None,) * self.num_envs
        return self.get_attr(name)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment.

        Args:
            name: "np_random" or "task", which each has its own, or "action_space", "metadata", "observation_space",
                "render_mode" or "spec", which they share.

        Raises:
            AttributeError: there is no such name.
        """
        if name in SHARED:
            return (getattr(self, SHARED[name]),) * self.num_envs
        if name == "task":
            return tuple(self._tasks)
        if name == "np_random":
            self._require_balls()
            return tuple(self._rngs)
        known = ", ".join(map(repr, sorted([*SHARED, "np_random", "task"])))
        raise AttributeError(
            f"name: expected one of {known}, or to call 'get_state', 'render' or 'what_if', received {name!r}; "
            "what moves environments moves the whole batch: use its own reset, step and set_state."
        )

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment: "np_random", to N generators.

        Raises:
            AttributeError: another name: all else is shared, or follows from the rules.
            ValueError: not N different generators such as ``gymnasium.utils.seeding.np_random`` makes.
        """
        if name != "np_random":
            raise AttributeError(f"name: expected 'np_random', received {name!r}; make a new batch for other options.")
        self._require_balls()
        rngs = one_each(values, self.num_envs, name)
        sources = [rng.bit_generator for rng in rngs if isinstance(rng, np.random.Generator)]
        sources = [source for source in sources if type(source) is np.random.PCG64]
        if len(set(map(id, sources))) < self.num_envs:
            raise ValueError(
                f"np_random: expected {self.num_envs} different generators of numpy's PCG64, received {rngs!r:.80}; "
                "environments that shared one would disturb each other."
            )
        self._rngs = np.array(rngs, dtype=object)

    def _require_balls(self) -> None:
        if len(self._rngs) == 0:
            raise gym.error.ResetNeeded("Call reset() first: there are no balls on the course yet.")
