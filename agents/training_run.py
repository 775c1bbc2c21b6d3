"""Shared parts of the sample training programs: configuration, run folder, environments, interruption, resumption.

A run folder contains

- ``config.json``: the configuration of the run;
- ``checkpoint.zip``: the newest model, from which the run resumes;
- ``best.zip``: the model that needed the fewest strokes in an evaluation;
- ``progress.json``: the evaluations of the checkpoints;
- ``scores.json``: the final evaluation;
- ``log`` or ``log_0``: the TensorBoard log.

train_generalist writes ``checkpoint.npz`` and ``best.npz`` instead of the .zip files, and resumes from
``checkpoint.pt``. train_rllib resumes from the folder ``checkpoint-TIMESTEPS``.

Files are written atomically, so that a run that is killed at any moment resumes from its last checkpoint.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import os
import shutil
import uuid
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import gymnasium as gym
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecMonitor

from agents.config_check import check_count, check_ranges, check_types, check_weights, one_line_errors
from agents.sb3_vec_env import SB3VecEnv
from minigolf_env._atomic_io import check_output_folder, commit, remove_stale_temps
from minigolf_env.evaluation import FIRST_EVALUATION_SEED, NUM_EVALUATION_SEEDS
from minigolf_env.players.model_files import check_sb3_file

RICH_CONSOLE = Console()
"""Console of all output, so that it does not break the progress bars."""


RUNS_FOLDER = Path("runs")
"""Folder of the run folders whose name is not given."""

NO_FOLDER = Path(os.devnull, "run")
"""Run folder that cannot exist: that of a run that is only checked."""


@dataclass(frozen=True)
class TrainConfig:
    """Command-line arguments of every training program."""

    course: str = "dogleg"
    """Name or file of a course, "round", or "procedural" for generated levels."""
    difficulty: str | None = None
    """Difficulty of generated levels: easy, medium or hard."""
    num_levels: int | None = None
    """Number of generated levels to train on, from level 0: at most 1,000,000, and at most ``eval_seed``; evaluations
    use other levels."""
    observation: str = "state"
    """Observation of the environment: state, rays, bounce_rays or pixels."""
    reward: str = "shaped"
    """Reward of the environment: shaped or strokes."""
    putt_noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviations of a putt's direction (degrees) and speed (fraction of it), in training and evaluation."""

    total_timesteps: int = 400_000
    """Number of putts to train on; a time step is a putt."""
    seed: int = 0
    """RNG seed. An uninterrupted run with the same arguments on the same machine gives the same model, bit for bit."""
    out: Path | None = None
    """New folder for the run; by default the first free one of runs/COURSE-1, runs/COURSE-2, ..."""
    resume: Path | None = None
    """Folder of a run to resume, with its stored arguments; the other arguments of this command line are ignored."""
    init_weights: Path | None = None
    """Model file of the same program whose weights a new run starts from, for a curriculum from easy to hard."""

    n_envs: int = 1024
    """Number of environments in the vector environment."""
    eval_freq: int = 50_000
    """Number of time steps between two checkpoints; each is evaluated, and the best one is kept."""
    n_eval_episodes: int = 500
    """Number of episodes in the evaluation of a checkpoint."""
    eval_seed: int = 2_000_000
    """First seed, or first level, of these episodes; 1,000,000 to 1,999,999 are reserved for the final evaluation."""
    n_test_episodes: int = 1000
    """Number of episodes in the final evaluation; random play, which is slow, gets a tenth of them."""
    n_search_episodes: int = 30
    """Number of episodes of search in the final evaluation; 0 leaves search out."""

    @property
    def env_args(self) -> dict[str, Any]:
        """Arguments of the environment that training and evaluation have in common."""
        return {"course": self.course, "difficulty": self.difficulty, "putt_noise": self.putt_noise}

    @property
    def eval_env_args(self) -> list[dict[str, Any]]:
        """Arguments of each environment that checkpoints and the final model are evaluated on."""
        return [self.env_args]


Config = TypeVar("Config", bound=TrainConfig)


def start_run(config: Config, check_model: Callable[[Config, Path | None], None]) -> tuple[Config, Path]:
    """Create the folder of a new run, or reopen the folder ``config.resume``, after all arguments have been checked.

    Args:
        config: configuration of the run.
        check_model: makes the model of a configuration, with the initial weights or the checkpoint of a run folder, and
            raises an error if that cannot be done.

    Returns:
        The configuration (when a run is resumed, the one stored in its folder) and the folder.

    Raises:
        SystemExit: an argument is invalid or the folder cannot be used; the message is one line.
    """
    folder = config.resume
    if folder is not None:
        config = read_config(type(config), folder)
    validate_config(config)
    try:
        check_output_folder(folder or config.out or RUNS_FOLDER, "resume" if folder else "out")
    except OSError as error:
        raise SystemExit(str(error)) from None
    with one_line_errors(_model_expectation(config, folder)):
        check_model(config, folder)
    try:
        if folder is None:
            return config, create_run_folder(config)
        remove_stale_temps(folder)
    except OSError as error:
        raise SystemExit(f"out: expected a folder to write to, received {error}; choose another folder.") from None
    return config, folder


def _model_expectation(config: TrainConfig, folder: Path | None) -> str:
    """Return the beginning of the message for a model that cannot be made."""
    if folder is not None:
        return "resume: expected an intact model of this program and observation"
    if config.init_weights is not None:
        return "init_weights: expected an intact model of this program and observation"
    return "expected arguments with which environments and model can be made"


def validate_config(config: TrainConfig) -> None:
    """Raise SystemExit with a one-line message if an argument is invalid, before any file is written."""
    # Check the numbers; training, checkpoints and the final evaluation use different levels.
    try:
        check_ranges(config)
    except ValueError as error:
        raise SystemExit(str(error)) from error
    max_levels = min(config.eval_seed, FIRST_EVALUATION_SEED)
    if config.num_levels is not None and not 0 < config.num_levels <= max_levels:
        raise SystemExit(
            f"num_levels: expected 1 to {max_levels}, received {config.num_levels}; "
            "the levels from there on are for evaluation."
        )
    eval_seeds = range(config.eval_seed, config.eval_seed + config.n_eval_episodes)
    held_out = range(FIRST_EVALUATION_SEED, FIRST_EVALUATION_SEED + NUM_EVALUATION_SEEDS)
    if eval_seeds[-1] >= held_out[0] and eval_seeds[0] <= held_out[-1]:
        raise SystemExit(
            f"eval_seed: expected episodes apart from those reserved for the final evaluation, {held_out[0]} to "
            f"{held_out[-1]}, received {eval_seeds[0]} to {eval_seeds[-1]}."
        )
    # Check the arguments of the environments.
    try:
        for env_args in config.eval_env_args:
            make_vector_env(dataclasses.replace(config, n_envs=1), env_args).close()
    except (OSError, RuntimeError, ValueError) as error:
        raise SystemExit(str(error)) from error


def create_run_folder(config: TrainConfig) -> Path:
    """Create the run folder with its configuration and return it; an existing folder is never overwritten.

    The folder appears with its configuration in it: a program that is killed leaves a run that can be resumed, or none.

    Raises:
        SystemExit: the folder ``config.out`` exists.
        OSError: the folder cannot be created.
    """
    stored = {**dataclasses.asdict(config), "out": None, "resume": None}
    parent = RUNS_FOLDER if config.out is None else config.out.parent
    parent.mkdir(parents=True, exist_ok=True)
    temporary = parent / f".new-run-{uuid.uuid4().hex}"
    temporary.mkdir()
    try:
        (temporary / "config.json").write_text(json.dumps(stored, indent=2, default=str), encoding="utf-8")
        if config.out is not None:
            if os.path.lexists(config.out):
                raise SystemExit(f"out: expected a new folder, {config.out} exists; {resume_hint(config.out)}")
            commit(temporary, config.out)
            return config.out
        for number in itertools.count(1):
            folder = parent / f"{Path(config.course).stem}-{number}"
            if not os.path.lexists(folder):
                try:
                    commit(temporary, folder)
                    return folder
                except OSError:
                    if not os.path.lexists(folder):  # Otherwise another run took the name at the same time.
                        raise
        raise AssertionError("unreachable: the numbers do not end")
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def read_config(config_class: type[Config], folder: Path, what: str = "resume") -> Config:
    """Return the configuration stored in a run folder, which error messages call ``what``.

    Raises:
        SystemExit: the folder has no configuration, it cannot be read, or it belongs to another program.
    """
    path = folder / "config.json"
    try:
        if not path.is_file():
            raise SystemExit(f"{what}: expected the folder of a run, {folder} has no {path.name}.")
        stored = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise SystemExit(
            f"{what}: expected the configuration of a run in {path}, received {error}; start a new run."
        ) from error
    if not isinstance(stored, dict) or stored.keys() != {field.name for field in dataclasses.fields(config_class)}:
        raise SystemExit(f"{what}: expected a run of this program, {folder} has the configuration of another.")
    try:
        return cast(Config, check_types(config_class, stored))
    except ValueError as error:
        raise SystemExit(f"{what}: expected the configuration of a run in {path}, {error} Start a new run.") from error


def resume_hint(folder: Path) -> str:
    """Return the sentence that says how to resume a run."""
    return f"To resume it: --resume {folder}"


@contextlib.contextmanager
def save_on_interrupt(folder: Path, save: Callable[[], None] | None = None) -> Iterator[None]:
    """Save on Ctrl-C within the block, and end the program with one line that says how to resume.

    A full disk or another OSError ends the program with such a line, too.

    Args:
        folder: run folder.
        save: writes a checkpoint; None if there is nothing left to save.
    """
    try:
        try:
            yield
        except KeyboardInterrupt:
            if save is not None:
                save()
            raise SystemExit(f"Interrupted and saved. {resume_hint(folder)}") from None
    except TimeoutError:  # An OSError as well, but Ray raises it: it has nothing to do with the disk.
        raise
    except OSError as error:
        has_checkpoint = any(folder.glob("checkpoint*"))
        state = "The last checkpoint is intact." if has_checkpoint else "There is no checkpoint yet."
        raise SystemExit(f"Could not save: {error}. {state} {resume_hint(folder)}") from error


def make_vector_env(config: TrainConfig, env_args: dict[str, Any]) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Return the vector environment for training with the arguments of the environment ``env_args``."""
    return gym.make_vec(
        "minigolf_env:MiniGolf-v0",
        num_envs=config.n_envs,
        autoreset_mode="SameStep",
        observation=config.observation,
        reward=config.reward,
        num_levels=config.num_levels,
        **env_args,
    )


def make_sb3_envs(config: TrainConfig) -> VecMonitor:
    """Return the vector environment as stable-baselines3's VecEnv, with episode statistics."""
    return VecMonitor(SB3VecEnv(make_vector_env(config, config.env_args)))


def initialize_model(model: BaseAlgorithm, config: TrainConfig, folder: Path) -> None:
    """Load the checkpoint of a run folder into a new model, or ``config.init_weights`` if there is no checkpoint."""
    checkpoint = folder / "checkpoint.zip"
    if checkpoint.exists():
        load_checkpoint(model, checkpoint)
        # Another seed than at the start, so that the environments do not repeat the same tees.
        model.set_random_seed(config.seed + model.num_timesteps)
        if isinstance(model, OffPolicyAlgorithm):  # The replay buffer is not saved: fill a new one first.
            model.learning_starts += model.num_timesteps
    elif config.init_weights is not None:
        check_sb3_file(config.init_weights)
        model.set_parameters(str(config.init_weights))
        check_weights(model.policy)
    model.tensorboard_log = str(folder)


def load_checkpoint(model: BaseAlgorithm, path: Path) -> None:
    """Load weights, optimizer states and counters from a checkpoint into a model.

    Unlike ``BaseAlgorithm.load`` it runs no code that is pickled in the file: an untrusted run is safe to resume.
    """
    check_sb3_file(path)
    _, parameters, variables = load_from_zip_file(path, device=model.device, load_data=False)
    model.set_parameters(parameters, device=model.device)
    check_weights(model.policy)
    for name, value in (variables or {}).items():  # SAC's entropy coefficient, which is no network parameter.
        getattr(model, name).data.copy_(value.data)
    with zipfile.ZipFile(path) as archive:
        data = json.loads(archive.read("data"))
    for name in ("num_timesteps", "_n_updates"):
        setattr(model, name, check_count(data.get(name), name))
