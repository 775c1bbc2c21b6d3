"""Players behind one interface: random, search, or a trained model."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import one_of
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.players.network import read_network
from minigolf_env.players.putt_features import NUMBERS, best
from minigolf_env.players.search import search

Action = NDArray[np.float32]

PRETRAINED_FOLDER = Path(__file__).parent / "pretrained"
"""The models that ship. The card beside each, .json, has its training command, scores and SHA-256."""

PRETRAINED_MODELS = {"ppo": "dogleg.npz", "generalist": "procedural.npz"}
"""Their files by name: "ppo" is for the default hole, "generalist" for procedural levels."""

POLICY_NAMES = ("random", "search", *PRETRAINED_MODELS)


class Policy(Protocol):
    """A player."""

    observation: str
    """What it sees: the environment's ``observation``."""

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the putt (2,) to play; a policy that learned looks at the observation, one that plans at the game."""
        ...


@runtime_checkable
class BatchPolicy(Policy, Protocol):
    """A player that needs no more than observations, and takes many at once."""

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return the putts (N, 2) to play after observations (N, ...)."""
        ...


class RandomPolicy:
    """Plays putts drawn uniformly from the disc of all putts, reproducibly.

    Args:
        seed: of the policy's own random numbers, at least 0.

    Raises:
        ValueError: the seed is below 0.
    """

    observation = "state"

    def __init__(self, seed: int = 0) -> None:
        if seed < 0:
            raise ValueError(f"seed: expected at least 0, received {seed}.")
        self._rng = np.random.default_rng(seed)

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return a random putt (2,)."""
        direction, share = self._rng.random(2)
        turn = 2.0 * np.pi * direction
        return np.asarray(np.sqrt(share) * np.array([np.cos(turn), np.sin(turn)]), dtype=np.float32)


class SearchPolicy:
    """Plays the best of the putts that ``planning.search`` tries from where the ball lies."""

    observation = "state"

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the best putt (2,) found."""
        return search(env).action


class ModelPolicy:
    """Plays what a trained model finds best, without exploring. Reading its file runs no code that is in it.

    Args:
        path: the .zip file that stable-baselines3's ``model.save`` wrote after training an "MlpPolicy" by PPO or SAC,
            or an .npz file that ``network.Network.save`` wrote.

    Raises:
        FileNotFoundError, ValueError, ImportError: as for ``network.read_network``; ValueError also if the model was
            trained with another number of observations than any kind has.
    """

    def __init__(self, path: str | Path) -> None:
        self.network = read_network(path)
        if self.network.judges and self.network.inputs != NUMBERS:
            raise ValueError(f"model: expected a judge of {NUMBERS} numbers, received one of {self.network.inputs}.")
        self.observation = "bounce_rays" if self.network.judges else _kind((self.network.inputs,))
        self.sha256 = _sha256(Path(path))
        """Of the file."""

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the mean of the policy's distribution (2,), or the putt that is judged best."""
        return np.asarray(self.act_batch(observation[None])[0])

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return such putts (N, 2): each has the bits of ``act``."""
        return best(observations, self.network.cost).actions if self.network.judges else self.network(observations)


class SB3Policy:
    """Plays a loaded model of any algorithm and network by its ``predict``, as stable-baselines3's models have it.

    Loading such a model, ``PPO.load(path)``, runs code that is pickled in the file: load only those you trust. The
    putts of a batch may differ from single ones in the last bits.

    Args:
        model: with ``predict(observations, deterministic=True)``, which returns putts and something else.
        observation: what it was trained with.
    """

    def __init__(self, model: Any, observation: str) -> None:
        self.observation = one_of(observation, tuple(OBSERVATIONS), "observation")
        self._model = model

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return what the model finds best (2,)."""
        return np.asarray(self.act_batch(observation[None])[0])

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return what the model finds best (N, 2)."""
        return np.asarray(self._model.predict(observations, deterministic=True)[0], dtype=np.float32)


def load_policy(name: str | Path, seed: int = 0) -> Policy:
    """Return the policy "random" (with its seed), "search", a model that ships by its name, or the model in a file.

    Raises:
        ValueError: the name is none of these, or the file holds something else.
        FileNotFoundError, ImportError: as for ModelPolicy.
    """
    if Path(name).suffix in (".zip", ".npz"):
        return ModelPolicy(name)
    known = one_of(name, POLICY_NAMES, "policy (or a model's .zip or .npz file)")
    if known in PRETRAINED_MODELS:
        return _shipped(known)
    return RandomPolicy(seed) if known == "random" else SearchPolicy()


def _shipped(name: str) -> ModelPolicy:
    """Return a model that ships, if it is the one on its card."""
    file = PRETRAINED_FOLDER / PRETRAINED_MODELS[name]
    card = file.with_suffix(".json")
    if not (file.is_file() and card.is_file()):
        raise FileNotFoundError(
            f"policy: expected the model that ships with the package, there is none at {file}; "
            f"train one with `python -m agents.train_{name}` and name its file."
        )
    if _sha256(file) != json.loads(card.read_text())["sha256"]:
        raise ValueError(f"policy: expected the model that {card} describes, received another; install again.")
    return ModelPolicy(file)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _kind(shape: tuple[int, ...]) -> str:
    """Return which kind of observation has a shape."""
    shapes = {name: observer.space().shape for name, observer in OBSERVATIONS.items()}
    if shape not in shapes.values():
        raise ValueError(f"model: expected one that sees an observation of {shapes}, received one that sees {shape}.")
    return next(name for name, known in shapes.items() if known == shape)
