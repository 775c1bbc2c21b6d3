"""Train stable-baselines3's PPO on a hole, and end with a table: random, search, PPO.

``python -m agents.train_ppo`` takes less than 10 minutes on two cores; ``--resume runs/dogleg-1`` goes on after an
interruption; ``tensorboard --logdir runs`` shows how it went.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
import tyro
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, ProgressBarCallback
from stable_baselines3.common.vec_env import VecMonitor

from agents.sb3_vec_env import SB3VecEnv
from minigolf_env import evaluation
from minigolf_env.policies import ModelPolicy, load_policy

CONSOLE = Console()


@dataclass(frozen=True)
class Args:
    """The command line. Defaults are what worked best of what was tried; see README.md for what they reach."""

    course: str = "dogleg"
    putts: int = 2_000_000
    """Putts to learn from."""
    minutes: float = 7.0
    """Longest time to learn (the closing table takes another minute or so); a resumed run starts with all of it."""
    seed: int = 0
    out: Path | None = None
    """Folder for checkpoints, log and scores, new; by default the first free one of runs/COURSE-1, -2, ..."""
    resume: Path | None = None
    """Go on with the run in this folder, with its arguments; all others on this command line are ignored."""

    num_envs: int = 512
    n_steps: int = 8
    """Putts in each environment between two updates."""
    batch_size: int = 1024
    n_epochs: int = 8
    target_kl: float = 0.05
    """An update ends early when the policy has moved this far."""
    learning_rate: float = 1e-3
    """At the start; falls linearly to 0 as putts or minutes run out."""
    gamma: float = 0.9
    gae_lambda: float = 0.5
    clip_range: float = 0.2
    log_std_init: float = -1.5
    """Log of the first standard deviation: 0.22 of the top speed. At 0.6 (-0.5) it drowned the short putts for long."""
    hidden: tuple[int, ...] = (64, 64)

    check_every: int = 50_000
    """Putts between two checkpoints, each evaluated; the best one is kept."""
    check_episodes: int = 200
    check_seed: int = 2_000_000
    """First seed of their episodes: not those of the closing table, which the best model is not chosen by."""
    final_episodes: int = 500
    """Episodes of the closing table for random and PPO."""
    search_episodes: int = 30
    """Episodes of the closing table for search, which thinks about every putt; 0 leaves search out."""


class Schedule:
    """The learning rate, falling linearly to 0 over the putts or the minutes, whichever run out first."""

    def __init__(self, start: float, minutes: float) -> None:
        self.start, self.seconds, self.began = start, 60.0 * minutes, time.monotonic()

    @property
    def time_left(self) -> float:
        """The share of the minutes that is left, at least 0."""
        return max(0.0, 1.0 - (time.monotonic() - self.began) / self.seconds)

    def __call__(self, putts_left: float) -> float:
        """Return the rate for the share of the putts that is left."""
        return self.start * min(putts_left, self.time_left)


class Checkpoints(BaseCallback):
    """Saves the model every so often, keeps the one that scored best over fixed seeds, and ends learning in time.

    Files are written beside their place and then moved there: an interruption leaves the last whole one.
    """

    def __init__(self, args: Args, folder: Path, schedule: Schedule) -> None:
        super().__init__()
        self.args, self.folder, self.schedule = args, folder, schedule
        progress = folder / "progress.json"
        self.best = json.loads(progress.read_text())["best_strokes"] if progress.is_file() else float("inf")
        self.saved_at = 0

    def _on_training_start(self) -> None:
        self.saved_at = self.num_timesteps

    def _on_step(self) -> bool:
        return self.schedule.time_left > 0.0

    def _on_rollout_start(self) -> None:
        # Between an update and the next putts: what is saved is what played.
        if self.num_timesteps - self.saved_at >= self.args.check_every:
            self.check()

    def check(self) -> None:
        """Save, evaluate, and keep the model if it is the best so far."""
        self.saved_at = self.num_timesteps
        checkpoint = self.save("checkpoint.zip")
        episodes, seed = self.args.check_episodes, self.args.check_seed
        score = evaluation.evaluate(
            ModelPolicy(checkpoint), "PPO", self.args.course, episodes=episodes, first_seed=seed, quiet=True
        )
        self.logger.record("eval/strokes", score.strokes)
        self.logger.record("eval/holed", score.holed)
        self.logger.record("eval/hole_in_one", score.hole_in_one)
        self.logger.dump(self.num_timesteps)
        if score.strokes < self.best:
            self.best = score.strokes
            self.save("best.zip")
        write(self.folder / "progress.json", json.dumps({"putts": self.num_timesteps, "best_strokes": self.best}))
        CONSOLE.print(
            f"{self.num_timesteps:>10,} putts: {score.strokes:.2f} strokes, {score.holed:.0%} holed, "
            f"{score.hole_in_one:.0%} holes-in-one (best {self.best:.2f})"
        )

    def save(self, name: str) -> Path:
        """Save the model under a name in the run's folder and return its path."""
        beside = self.folder / f".{name}"
        self.model.save(beside)
        return beside.replace(self.folder / name)


def write(path: Path, text: str) -> None:
    """Write a text file so that it is never half there."""
    beside = path.with_name(f".{path.name}")
    beside.write_text(text)
    beside.replace(path)


def make_envs(args: Args) -> VecMonitor:
    """Return the native batch as stable-baselines3 wants it."""
    envs = gym.make_vec(
        "minigolf_env:MiniGolf-v0", num_envs=args.num_envs, course=args.course, autoreset_mode="SameStep"
    )
    return VecMonitor(SB3VecEnv(envs))


def make_model(args: Args, envs: VecMonitor, folder: Path, schedule: Schedule) -> PPO:
    """Return a new learner."""
    return PPO(
        "MlpPolicy",
        envs,
        learning_rate=schedule,
        n_steps=args.n_steps,
        batch_size=args.batch_size,
        n_epochs=args.n_epochs,
        target_kl=args.target_kl,
        gamma=args.gamma,
        gae_lambda=args.gae_lambda,
        clip_range=args.clip_range,
        policy_kwargs={
            "net_arch": list(args.hidden),
            "activation_fn": torch.nn.Tanh,
            "log_std_init": args.log_std_init,
        },
        tensorboard_log=str(folder),
        seed=args.seed,
        device="cpu",
    )


def train(args: Args, folder: Path) -> None:
    """Learn until the putts are played, from the folder's checkpoint if it has one; Ctrl-C saves and leaves."""
    torch.set_num_threads(1)  # The networks are tiny: a second thread mostly waits for the first, at full load.
    envs = make_envs(args)
    schedule = Schedule(args.learning_rate, args.minutes)
    resume = (folder / "checkpoint.zip").is_file()
    if resume:
        mine = {"learning_rate": schedule, "lr_schedule": schedule}
        model = PPO.load(folder / "checkpoint.zip", env=envs, device="cpu", custom_objects=mine)
    else:
        model = make_model(args, envs, folder, schedule)
    checkpoints = Checkpoints(args, folder, schedule)
    try:
        # The numbers of putts add up over resumed runs, and so does the learning rate's way down.
        model.learn(
            max(0, args.putts - model.num_timesteps),
            callback=[checkpoints, ProgressBarCallback()],
            reset_num_timesteps=not resume,
            tb_log_name="log",
        )
        checkpoints.check()
    except KeyboardInterrupt:
        checkpoints.save("checkpoint.zip")
        raise SystemExit(f"Interrupted and saved. Go on with: python -m agents.train_ppo --resume {folder}") from None
    finally:
        envs.close()


def final_table(args: Args, folder: Path) -> list[evaluation.Score]:
    """Evaluate random, search and the best model side by side."""
    scores = []
    players = {"random": args.final_episodes, "search": args.search_episodes, "PPO": args.final_episodes}
    for name, episodes in players.items():
        if episodes > 0:
            policy = ModelPolicy(folder / "best.zip") if name == "PPO" else load_policy(name)
            scores.append(evaluation.evaluate(policy, name, args.course, episodes=episodes))
    write(folder / "scores.json", json.dumps([dataclasses.asdict(score) for score in scores], indent=2) + "\n")
    return scores


def new_folder(args: Args) -> Path:
    """Make the run's folder and return it; an earlier run is never overwritten.

    Raises:
        SystemExit: the folder asked for exists.
    """
    folders = [args.out] if args.out else (Path("runs") / f"{args.course}-{i}" for i in itertools.count(1))
    folder = next(path for path in folders if args.out or not path.exists())
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise SystemExit(f"out: expected a new folder, {folder} exists; to go on with it: --resume {folder}") from None
    return folder


def read_args(folder: Path) -> Args:
    """Return the arguments a run was started with.

    Raises:
        SystemExit: there is no run to go on with.
    """
    if not (folder / "args.json").is_file():
        raise SystemExit(f"resume: expected the folder of a run, {folder} has no args.json.")
    stored: dict[str, Any] = json.loads((folder / "args.json").read_text())
    return Args(**{**stored, "hidden": tuple(stored["hidden"])})


def main(args: Args) -> list[evaluation.Score]:
    """Train, evaluate, print the table."""
    began = time.monotonic()
    if args.resume is not None:
        folder = args.resume
        args = read_args(folder)
    else:
        folder = new_folder(args)
        stored = {**dataclasses.asdict(args), "out": None, "resume": None}
        write(folder / "args.json", json.dumps(stored, indent=2) + "\n")
    train(args, folder)
    scores = final_table(args, folder)
    evaluation.print_scores(scores)
    CONSOLE.print(
        f"{time.monotonic() - began:.0f} s in all. Model: {folder / 'best.zip'}; log: tensorboard --logdir {folder}"
    )
    return scores


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
