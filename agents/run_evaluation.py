"""Evaluation of a training run: its checkpoints on fixed episodes, and at the end its best model on others."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import FiniteFloat
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from agents.config_check import check_types
from agents.training_run import (
    NO_FOLDER,
    RICH_CONSOLE,
    TrainConfig,
    initialize_model,
    load_checkpoint,
    make_sb3_envs,
)
from minigolf_env._atomic_io import atomic_write, write_text
from minigolf_env.evaluation.evaluate import EvaluationResult, evaluate
from minigolf_env.evaluation.report import print_evaluations, write_json_report
from minigolf_env.players.policies import Policy, SB3Policy, load_policy

EVALUATION_METRICS = ("strokes", "holed", "hole_in_one")
"""Fields of an evaluation that are averaged over its environments, stored and logged."""


def load_best(model: BaseAlgorithm, config: TrainConfig, folder: Path) -> SB3Policy:
    """Load the best checkpoint of a run into a model, and return a policy that plays it."""
    load_checkpoint(model, folder / "best.zip")
    return SB3Policy(model, config.observation)


def check_sb3_model(
    make_model: Callable[[Any, VecMonitor], BaseAlgorithm], config: TrainConfig, folder: Path | None
) -> None:
    """Make a model and load the initial weights into it, or the files of the run folder that is resumed.

    Raises:
        Exception: that cannot be done; libraries raise errors of many kinds.
    """
    with contextlib.closing(make_sb3_envs(config)) as envs:
        model = make_model(config, envs)
        initialize_model(model, config, folder or NO_FOLDER)
        if folder is not None and check_history(config, folder, "checkpoint.zip").rows:
            load_best(model, config, folder)


class EvaluationHistory:
    """Evaluations of a run's checkpoints, on fixed episodes; stored in progress.json."""

    def __init__(self, config: TrainConfig, folder: Path) -> None:
        self._config = config
        self._path = folder / "progress.json"
        self.rows: list[dict[str, float]] = json.loads(self._path.read_text()) if self._path.exists() else []
        check_types(list[dict[str, FiniteFloat]], self.rows)
        if not all("strokes" in row for row in self.rows):
            raise ValueError(f"{self._path}: expected the evaluations of a run, received others")

    @property
    def best_strokes(self) -> float:
        """Fewest mean strokes of all evaluations; infinite if there is none."""
        return min((row["strokes"] for row in self.rows), default=float("inf"))

    def evaluate(self, policy: Policy, timesteps: int) -> dict[str, float]:
        """Return the means over all environments of the evaluation.

        Args:
            policy: policy to evaluate.
            timesteps: number of time steps that it has learned from, a field of the result.
        """
        config = self._config
        scores = [
            evaluate(
                policy,
                "agent",
                **env_args,
                episodes=config.n_eval_episodes,
                first_seed=config.eval_seed,
                quiet=True,
            )
            for env_args in config.eval_env_args
        ]
        means = {name: sum(getattr(score, name) for score in scores) / len(scores) for name in EVALUATION_METRICS}
        return {"timesteps": timesteps, **means}

    def append(self, row: dict[str, float]) -> None:
        """Store and print an evaluation."""
        self.rows.append(row)
        write_text(self._path, json.dumps(self.rows))
        RICH_CONSOLE.print(
            f"{row['timesteps']:>10,} time steps: {row['strokes']:.2f} strokes, {row['holed']:.0%} holed, "
            f"{row['hole_in_one']:.0%} holes-in-one (best {self.best_strokes:.2f})"
        )


def check_history(config: TrainConfig, folder: Path, checkpoint: str) -> EvaluationHistory:
    """Return the evaluations of the run folder that is resumed, after a check that what they evaluated is there.

    Args:
        config: configuration of the run.
        folder: run folder.
        checkpoint: name or pattern of the checkpoints that the run resumes from.

    Raises:
        Exception: the evaluations cannot be read, or there are evaluations and no checkpoint.
    """
    history = EvaluationHistory(config, folder)
    if history.rows and not any(folder.glob(checkpoint)):
        raise FileNotFoundError(f"evaluations without {folder / checkpoint}, from which the run would resume")
    return history


class EvalCheckpointCallback(BaseCallback):
    """Saves a checkpoint every ``eval_freq`` time steps, evaluates it, and keeps the best one.

    stable-baselines3's EvalCallback and CheckpointCallback rank models by return instead of strokes, do not fix the
    episodes of an evaluation, and leave a broken file when they are killed while they save.
    """

    def __init__(self, config: TrainConfig, folder: Path, model: BaseAlgorithm) -> None:
        super().__init__()
        self.config = config
        self.folder = folder
        self.history = EvaluationHistory(config, folder)
        self.last_saved = 0
        self.init_callback(model)

    def _on_training_start(self) -> None:
        self.last_saved = self.num_timesteps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # Save between an update and the next rollout: the saved model is the one that plays this rollout.
        if self.num_timesteps - self.last_saved >= self.config.eval_freq:
            self.save_and_evaluate()

    def save_and_evaluate(self) -> None:
        """Save the model, evaluate it, and keep it if it is the best so far."""
        self.last_saved = self.num_timesteps
        self.save("checkpoint.zip")
        row = self.history.evaluate(SB3Policy(self.model, self.config.observation), self.num_timesteps)
        if row["strokes"] < self.history.best_strokes:
            self.save("best.zip")
        self.history.append(row)
        for name in EVALUATION_METRICS:
            self.logger.record(f"eval/{name}", row[name])
        self.logger.dump(self.num_timesteps)

    def save(self, name: str = "checkpoint.zip") -> None:
        """Save the model under a name in the run folder."""
        with atomic_write(self.folder / name) as temporary_file:
            self.model.save(temporary_file)


def finish_run(
    config: TrainConfig, name: str, policy: Policy, model_path: Path, started: float
) -> list[EvaluationResult]:
    """Evaluate random play, search and the best model on the same episodes; store and print the results.

    Args:
        config: configuration of the run.
        name: name of the model in the tables.
        policy: policy that plays the best model.
        model_path: file of the best model in the run folder.
        started: start of the run, by ``time.monotonic``.
    """
    folder = model_path.parent
    entries: list[tuple[str, Policy, int]] = [
        ("random", load_policy("random"), math.ceil(config.n_test_episodes / 10)),
        ("search", load_policy("search"), config.n_search_episodes),
        (name, policy, config.n_test_episodes),
    ]
    tables = [
        [
            evaluate(evaluated, label, **env_args, episodes=episodes)
            for label, evaluated, episodes in entries
            if episodes > 0
        ]
        for env_args in config.eval_env_args
    ]
    scores = [score for table in tables for score in table]
    record = [dataclasses.asdict(score) for score in scores]
    write_json_report(folder / "scores.json", "stable-baselines3", "torch", scores=record)
    for table in tables:
        print_evaluations(table)
    RICH_CONSOLE.print(f"{time.monotonic() - started:.0f} s in all. Log: tensorboard --logdir {folder}", soft_wrap=True)
    if config.observation != "pixels":  # Only stable-baselines3 reads files of convolutional networks.
        difficulty = "" if config.difficulty is None else f" --difficulty {config.difficulty}"
        command = f"minigolf video --policy {model_path} --course {config.course}{difficulty} -o putt.mp4"
        RICH_CONSOLE.print(f"Watch it play: {command}", soft_wrap=True)
    return scores
