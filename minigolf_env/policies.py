"""Players behind one interface: random, search, or a model trained with stable-baselines3."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.physics.checks import one_of
from minigolf_env.planning import search

Action = NDArray[np.float32]


class Policy(Protocol):
    """A player."""

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> Action:
        """Return the putt (2,) to play; a policy that learned looks at the observation, one that plans at the game."""
        ...


class RandomPolicy:
    """Plays putts drawn uniformly from the disc of all putts, reproducibly.

    Args:
        seed: of the policy's own random numbers.
    """

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> Action:
        """Return a random putt (2,)."""
        direction, share = self._rng.random(2)
        turn = 2.0 * np.pi * direction
        return np.asarray(np.sqrt(share) * np.array([np.cos(turn), np.sin(turn)]), dtype=np.float32)


class SearchPolicy:
    """Plays the best of the putts that ``planning.search`` tries from where the ball lies."""

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> Action:
        """Return the best putt (2,) found."""
        return search(env).action


class ModelPolicy:
    """Plays what a model learned with stable-baselines3's PPO finds best, without exploring.

    Loading runs code that is pickled in the file: load only models you trust.

    Args:
        path: the .zip file that ``model.save`` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ImportError: stable-baselines3 is not installed.
    """

    def __init__(self, path: str | Path) -> None:
        if not Path(path).is_file():
            raise FileNotFoundError(f"model: expected a .zip file that model.save() wrote, there is none at {path}.")
        try:
            from stable_baselines3 import PPO
        except ImportError as error:
            raise ImportError("A trained model needs stable-baselines3: pip install 'minigolf-env[agents]'.") from error
        self._model: Any = PPO.load(path, device="cpu")

    def act(self, observation: NDArray[np.float32], env: MiniGolfEnv) -> Action:
        """Return the mean of the policy's distribution (2,)."""
        action, _ = self._model.predict(observation, deterministic=True)
        return np.asarray(action, dtype=np.float32)


def load_policy(name: str | Path, seed: int = 0) -> Policy:
    """Return the policy "random" (with its seed), "search", or the model in a .zip file.

    Raises:
        ValueError: the name is neither.
        FileNotFoundError, ImportError: as for ModelPolicy.
    """
    if str(name).endswith(".zip"):
        return ModelPolicy(name)
    known = one_of(name, ("random", "search"), "policy (or a model's .zip file)")
    return RandomPolicy(seed) if known == "random" else SearchPolicy()
