"""Policies behind one interface: random, search, and trained models."""

from __future__ import annotations

import hashlib
import json
import warnings
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import integer, one_of, quote
from minigolf_env.courses import ROUND_COURSE, ROUND_HOLES
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.observations import OBSERVATIONS
from minigolf_env.players.model_files import load_model
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_optimizer import optimize_putt
from minigolf_env.players.putt_value_model import PuttValueModel
from minigolf_env.players.search import search

Action = NDArray[np.float32]

PRETRAINED_FOLDER = Path(__file__).parent / "pretrained"
"""Folder of the pretrained models. A model's card, .json, has its training command, scores and SHA-256."""

PRETRAINED_MODELS = {"ppo": "dogleg.npz", "generalist": "procedural.npz"}
"""Files of the pretrained models by name: "ppo" is for the default hole, "generalist" for procedural levels."""

POLICY_NAMES = ("random", "search", *PRETRAINED_MODELS)
"""Names of the policies that need no model file."""


class Policy(Protocol):
    """A policy: it chooses the next putt."""

    observation: str
    """The kind of observation that the policy needs: the environment's ``observation`` argument."""

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the putt to play, shape (2,). Trained policies use the observation; search uses the environment."""
        ...


@runtime_checkable
class BatchPolicy(Policy, Protocol):
    """A policy that needs only observations and accepts batches of them."""

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return the putts to play (N, 2) for observations (N, ...)."""
        ...


class RandomPolicy:
    """A policy that plays putts drawn uniformly from the disc of all putts, reproducibly.

    Args:
        seed: seed of the policy's own random numbers, at least 0.

    Raises:
        ValueError: the seed is not an integer of at least 0.
    """

    observation = "state"

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(integer(seed, "seed", 0))

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return a random putt (2,)."""
        turn, area = self._rng.random(2)
        direction = 2.0 * np.pi * turn
        return np.asarray(np.sqrt(area) * np.array([np.cos(direction), np.sin(direction)]), dtype=np.float32)


class SearchPolicy:
    """A policy that plays the putt that ``search`` finds from the ball's position."""

    observation = "state"

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the best putt (2,) found."""
        return search(env).action


class ModelPolicy:
    """A policy that plays the action a trained model considers best, without exploring.

    Reading the model's file runs no code from it.

    Args:
        path: the .zip file that stable-baselines3's ``model.save`` wrote after training an "MlpPolicy" with PPO or SAC,
            or an .npz file that ``model_files.save_model`` wrote.

    Raises:
        FileNotFoundError, ValueError, ImportError: as ``model_files.load_model``. ValueError also if the model has
            another number of inputs than every kind of observation.
    """

    def __init__(self, path: str | Path) -> None:
        self.model = load_model(path)
        num_inputs = self.model.mlp.num_inputs
        if isinstance(self.model, PuttValueModel):
            if num_inputs != NUM_FEATURES:
                raise ValueError(f"model: expected a value model of {NUM_FEATURES} features, received {num_inputs}.")
            self.observation = "bounce_rays"
        else:
            self.observation = _infer_observation((num_inputs,))
        self.sha256 = _sha256(Path(path))
        """SHA-256 of the file."""
        self.courses = _find_training_courses(Path(path))
        """Names of the courses that the model was trained on; None: nothing next to its file says so."""

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the mean of the policy's distribution, or the putt with the fewest expected strokes, shape (2,)."""
        return np.asarray(self.act_batch(observation[None])[0])

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return the putts (N, 2); each has the same bits as that of ``act``."""
        if isinstance(self.model, PuttValueModel):
            return optimize_putt(observations, self.model.expected_strokes).actions
        return self.model.act_batch(observations)


class SB3Policy:
    """A policy that plays the ``predict`` of a loaded stable-baselines3 model, of any algorithm and network.

    Loading such a model, ``PPO.load(path)``, runs code that is pickled in the file: load only files you trust. The
    putts of a batch may differ from single ones in the last bits.

    Args:
        model: an object with ``predict(observations, deterministic=True)``, which returns actions and something else.
        observation: the kind of observation that the model was trained with.
    """

    def __init__(self, model: Any, observation: str) -> None:
        self.observation = one_of(observation, tuple(OBSERVATIONS), "observation")
        expected = OBSERVATIONS[observation].space().shape
        space = getattr(model, "observation_space", None)
        # stable-baselines3 puts the channels of an image first.
        if space is not None and sorted(space.shape) != sorted(expected or ()):
            raise ValueError(
                f"observation: expected the one that the model was trained with, of shape {space.shape}, received "
                f"{quote(observation)} of shape {expected}."
            )
        self._model = model

    def act(self, observation: NDArray[Any], env: MiniGolfEnv) -> Action:
        """Return the model's deterministic action (2,)."""
        return np.asarray(self.act_batch(observation[None])[0])

    def act_batch(self, observations: NDArray[Any]) -> Action:
        """Return the model's deterministic actions (N, 2)."""
        return np.asarray(self._model.predict(observations, deterministic=True)[0], dtype=np.float32)


def warn_if_untrained(policy: Policy, course: str) -> None:
    """Warn if a model plays a course that it was not trained on, unless it observed the walls of many in training."""
    courses = getattr(policy, "courses", None)
    if courses is None or course in courses or (ROUND_COURSE in courses and course in ROUND_HOLES):
        return
    if policy.observation == "state" or not courses & {PROCEDURAL_COURSE, ROUND_COURSE}:
        warnings.warn(
            f"the model was trained on {', '.join(sorted(courses))}, not on {quote(course)}: expect it to putt as if "
            'it were there; train one for this course, or one that observes "rays" on course="procedural".',
            UserWarning,
            stacklevel=3,
        )


def _find_training_courses(model: Path) -> frozenset[str] | None:
    """Return the courses that a model's card, or the configuration of its run, names."""
    try:
        card = model.with_suffix(".json")
        if card.is_file():
            return frozenset(score["course"] for score in json.loads(card.read_text())["scores"])
        return frozenset([json.loads(model.with_name("config.json").read_text())["course"]])
    except (AttributeError, LookupError, OSError, TypeError, ValueError):
        return None  # No such file, or one of another program.


def load_policy(name: str | Path, seed: int = 0) -> Policy:
    """Return the policy "random" (with a seed), "search", a pretrained model by its name, or the model in a file.

    Raises:
        ValueError: the name is none of these, or the file contains something else.
        FileNotFoundError, ImportError: as ModelPolicy.
    """
    if Path(name).suffix in (".zip", ".npz"):
        return ModelPolicy(name)
    checked = one_of(name, POLICY_NAMES, "policy (or a model's .zip or .npz file)")
    if checked in PRETRAINED_MODELS:
        return _load_pretrained(checked)
    return RandomPolicy(seed) if checked == "random" else SearchPolicy()


def _load_pretrained(name: str) -> ModelPolicy:
    """Return a pretrained model, if it is the one that its card describes."""
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


def _infer_observation(shape: tuple[int, ...]) -> str:
    """Return the kind of observation that has a shape: a model's file holds no name of its observation.

    Raises:
        ValueError: no kind of observation has this shape, or more than one has.
    """
    shapes = {name: observation.space().shape for name, observation in OBSERVATIONS.items()}
    matches = [name for name in shapes if shapes[name] == shape]
    if not matches:
        raise ValueError(f"model: expected one trained on an observation of {shapes}, received one trained on {shape}.")
    if len(matches) > 1:
        raise ValueError(
            f"model: expected one observation of the shape {shape}, received {matches}; register observations of "
            "different shapes, or play the model with SB3Policy, which takes the observation's name."
        )
    return matches[0]
