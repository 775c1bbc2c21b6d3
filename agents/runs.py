"""A training run: its folder, its checkpoints, and the table that ends it. Any algorithm of stable-baselines3 can run.

The folder has args.json (the run's arguments), checkpoint.zip (the newest model), best.zip (the one that scored best on
fixed episodes), progress.json (the checkpoints' scores), scores.json (the table) and TensorBoard's log. Files are
written whole or not at all, so that a run killed at any moment goes on from its last checkpoint.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import time
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import gymnasium as gym
import torch
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, ProgressBarCallback
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecMonitor

from agents.sb3_vec_env import SB3VecEnv
from minigolf_env._atomic_io import atomic_write, remove_stale_temps, write_text
from minigolf_env.evaluation.evaluate import EvaluationResult, evaluate
from minigolf_env.evaluation.report import print_evaluations, write_json_report
from minigolf_env.players.model_files import check_sb3_file
from minigolf_env.players.policies import Policy, SB3Policy, load_policy

CONSOLE = Console()


@dataclass(frozen=True)
class Run:
    """What every training program's command line has."""

    course: str = "dogleg"
    """A hole, or "procedural" for levels."""
    difficulty: str | None = None
    """Of the levels: easy, medium or hard."""
    num_levels: int | None = None
    """Levels to train on, from level 0 on; checkpoints are scored on others."""
    observation: str = "state"
    """What the agent sees: state, rays, echoes or pixels."""
    reward: str = "shaped"
    """What it learns from: shaped or strokes."""
    putt_noise: tuple[float, float] = (0.0, 0.0)
    """Standard deviations of a putt's direction (degrees) and speed (share of it), in training and scores."""

    putts: int = 400_000
    """Putts to learn from."""
    seed: int = 0
    """The same seed, arguments and machine give the same model, bit for bit, if the run is not interrupted."""
    out: Path | None = None
    """Folder of the run, new; by default the first free one of runs/COURSE-1, -2, ..."""
    resume: Path | None = None
    """Go on with the run in this folder, with its arguments; all others on this command line are ignored."""

    start: Path | None = None
    """A model of the same program to begin with: its weights. To learn a harder game after an easier one."""
    num_envs: int = 1024
    check_every: int = 50_000
    """Putts between two checkpoints, each scored; the best one is kept."""
    check_episodes: int = 500
    check_seed: int = 2_000_000
    """First seed of their episodes, or first level: not those of the closing table, which chooses nothing."""
    final_episodes: int = 1000
    """Episodes of the closing table; a tenth as many for random, who plays one after the other."""
    search_episodes: int = 30
    """Its episodes for search, which thinks about every putt; 0 leaves search out."""

    @property
    def game(self) -> dict[str, Any]:
        """What is played, in training and in scores."""
        return {"course": self.course, "difficulty": self.difficulty, "putt_noise": self.putt_noise}

    @property
    def games(self) -> list[dict[str, Any]]:
        """The games that checkpoints and the closing table are scored on."""
        return [self.game]


Args = TypeVar("Args", bound=Run)

Build = Callable[[Args, VecMonitor], BaseAlgorithm]
"""Makes a new learner from a run's arguments and environments."""


def run(args: Args, build: Build[Args], callbacks: Callable[[Args], Sequence[BaseCallback]]) -> list[EvaluationResult]:
    """Train a new learner, or go on with one; end with a table: random, search, the agent.

    Args:
        args: of the run; with ``resume``, only the folder in it counts.
        build: makes the learner.
        callbacks: makes what else happens while it learns.

    Raises:
        SystemExit: with a line that says what is wrong, or how to go on after Ctrl-C or a full disk.
    """
    began = time.monotonic()
    args, folder = begin(args)
    learner = train(args, build, callbacks(args), folder)
    with stoppable(folder, lambda: None):
        return end(args, type(learner).__name__, best_of(learner, args, folder), folder / "best.zip", began)


def begin(args: Args) -> tuple[Args, Path]:
    """Return a run's arguments and its folder: a new one, or with ``resume`` those of the run to go on with.

    Raises:
        SystemExit: with a line that says what is wrong.
    """
    if args.resume is not None:
        resumed = read_args(type(args), args.resume), args.resume
        remove_stale_temps(args.resume)
        return resumed
    check(args)
    stored = {**dataclasses.asdict(args), "out": None, "resume": None}
    try:
        folder = new_folder(args)
        write_text(folder / "args.json", json.dumps(stored, indent=2, default=str))
    except OSError as error:
        raise SystemExit(f"out: expected a folder to write to, received {error}; choose another folder.") from None
    return args, folder


def check(args: Run) -> None:
    """Raise SystemExit with a line that says what is wrong with a run's arguments, before anything is made of them."""
    if args.final_episodes < 1:
        raise SystemExit(f"final_episodes: expected at least 1, received {args.final_episodes}.")
    if args.num_levels is not None and not 0 < args.num_levels <= args.check_seed:
        raise SystemExit(
            f"num_levels: expected 1 to {args.check_seed}, received {args.num_levels}; later ones are for scores."
        )
    if args.start is not None and not args.start.is_file():
        raise SystemExit(f"start: expected a model's .zip file, there is none at {args.start}.")
    try:
        for game in args.games:
            make_batch(dataclasses.replace(args, num_envs=1), game).close()
    except ValueError as error:
        raise SystemExit(str(error)) from error


def end(args: Run, name: str, best: Policy, file: Path, began: float) -> list[EvaluationResult]:
    """Make and print the tables of a run's best model, a file in its folder; say what to do with it.

    ``name`` is what they call it, ``began`` when the run began, by the monotonic clock.
    """
    scores = final_tables(args, name, best, file.parent)
    CONSOLE.print(f"{time.monotonic() - began:.0f} s in all. Log: tensorboard --logdir {file.parent}", soft_wrap=True)
    if args.observation != "pixels":  # Files of convolutional networks are read by stable-baselines3 alone.
        levels = "" if args.difficulty is None else f" --difficulty {args.difficulty}"
        words = f"minigolf video --policy {file} --course {args.course}{levels} -o putt.mp4"
        CONSOLE.print(f"Watch it play: {words}", soft_wrap=True)
    return scores


def train(args: Args, build: Build[Args], callbacks: Sequence[BaseCallback], folder: Path) -> BaseAlgorithm:
    """Learn until the putts are played, from the folder's checkpoint if it has one; return the learner."""
    torch.set_num_threads(1)  # The networks are tiny: a second thread mostly waits for the first, at full load.
    envs = make_envs(args)
    model = build(args, envs)
    resume = (folder / "checkpoint.zip").is_file()
    if resume:
        restore(model, folder / "checkpoint.zip")
        model.set_random_seed(args.seed + model.num_timesteps)  # Not the same tees again.
        if isinstance(model, OffPolicyAlgorithm):  # Its memory is not saved: first it collects a new one.
            model.learning_starts += model.num_timesteps
    elif args.start is not None:
        check_sb3_file(args.start)
        model.set_parameters(str(args.start))
    model.tensorboard_log = str(folder)
    checkpoints = Checkpoints(args, folder)
    checkpoints.init_callback(model)
    try:
        with stoppable(folder, lambda: checkpoints.save("checkpoint.zip")):
            # The numbers of putts add up over resumed runs, and so does the schedules' way down.
            model.learn(
                max(0, args.putts - model.num_timesteps),
                callback=[*callbacks, checkpoints, ProgressBarCallback()],
                reset_num_timesteps=not resume,
                tb_log_name="log",
            )
            checkpoints.check()
    finally:
        envs.close()
    return model


def restore(model: BaseAlgorithm, path: Path) -> None:
    """Put a checkpoint's weights, optimizers and counts into a new learner.

    Unlike ``load`` it runs no code that is pickled in the file: a run of someone else's may be gone on with, too.
    """
    check_sb3_file(path)
    _, parameters, variables = load_from_zip_file(path, device=model.device, load_data=False)
    model.set_parameters(parameters, device=model.device)
    for name, value in (variables or {}).items():  # SAC's entropy coefficient, which is no network's.
        getattr(model, name).data.copy_(value.data)
    with zipfile.ZipFile(path) as archive:
        about = json.loads(archive.read("data"))
    for count in ("num_timesteps", "_n_updates"):
        setattr(model, count, about[count])


def make_batch(args: Run, game: dict[str, Any]) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Return the native batch that a game is learned in."""
    return gym.make_vec(
        "minigolf_env:MiniGolf-v0",
        num_envs=args.num_envs,
        autoreset_mode="SameStep",
        observation=args.observation,
        reward=args.reward,
        num_levels=args.num_levels,
        **game,
    )


def make_envs(args: Run) -> VecMonitor:
    """Return the native batch as stable-baselines3 wants it."""
    return VecMonitor(SB3VecEnv(make_batch(args, args.game)))


@contextlib.contextmanager
def stoppable(folder: Path, save: Callable[[], None]) -> Iterator[None]:
    """While it lasts, Ctrl-C saves, and it and a full disk end the program with a line that says how to go on."""
    try:
        try:
            yield
        except KeyboardInterrupt:
            save()
            raise SystemExit(f"Interrupted and saved. {_go_on(folder)}") from None
    except TimeoutError:  # An OSError, too, but Ray's: it says nothing of the disk.
        raise
    except OSError as error:
        kept = "The last checkpoint is whole." if any(folder.glob("checkpoint*")) else "There is no checkpoint yet."
        raise SystemExit(f"Could not save: {error}. {kept} {_go_on(folder)}") from error


class Progress:
    """The scores of a run's checkpoints, over fixed episodes."""

    def __init__(self, args: Run, folder: Path) -> None:
        self.args, self.file = args, folder / "progress.json"
        self.history: list[dict[str, float]] = json.loads(self.file.read_text()) if self.file.is_file() else []

    def score(self, policy: Policy, putts: int, keep: Callable[[], None]) -> dict[str, float]:
        """Score a policy after so many putts, keep it if it is the best so far, and note the means down."""
        args, best = self.args, min((row["strokes"] for row in self.history), default=float("inf"))
        settings: dict[str, Any] = {"episodes": args.check_episodes, "first_seed": args.check_seed, "quiet": True}
        scores = [evaluate(policy, "agent", **game, **settings) for game in args.games]
        row = {
            name: sum(getattr(score, name) for score in scores) / len(scores)
            for name in ("strokes", "holed", "hole_in_one")
        }
        if row["strokes"] < best:
            keep()
        self.history.append({"putts": putts, **row})
        write_text(self.file, json.dumps(self.history))
        CONSOLE.print(
            f"{putts:>10,} putts: {row['strokes']:.2f} strokes, {row['holed']:.0%} holed, "
            f"{row['hole_in_one']:.0%} holes-in-one (best {min(best, row['strokes']):.2f})"
        )
        return row


class Checkpoints(BaseCallback):
    """Saves the model every so often, and keeps the one that scored best."""

    def __init__(self, args: Run, folder: Path) -> None:
        super().__init__()
        self.args, self.folder, self.progress = args, folder, Progress(args, folder)
        self.saved_at = 0

    def _on_training_start(self) -> None:
        self.saved_at = self.num_timesteps

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # Between an update and the next putts: what is saved is what played.
        if self.num_timesteps - self.saved_at >= self.args.check_every:
            self.check()

    def check(self) -> None:
        """Save, score, and keep the model if it is the best so far."""
        self.saved_at = self.num_timesteps
        self.save("checkpoint.zip")
        policy = SB3Policy(self.model, self.args.observation)
        row = self.progress.score(policy, self.num_timesteps, lambda: self.save("best.zip"))
        for name, value in row.items():
            self.logger.record(f"eval/{name}", value)
        self.logger.dump(self.num_timesteps)

    def save(self, name: str) -> None:
        """Save the model under a name in the run's folder."""
        with atomic_write(self.folder / name) as part:
            self.model.save(part)


def best_of(learner: BaseAlgorithm, args: Run, folder: Path) -> SB3Policy:
    """Return a player of a run's best model, whose weights the learner takes over."""
    restore(learner, folder / "best.zip")
    return SB3Policy(learner, args.observation)


def final_tables(args: Run, name: str, best: Policy, folder: Path) -> list[EvaluationResult]:
    """Score random, search and the best model on the same episodes, print a table for each game, and store them."""
    players = {
        "random": (load_policy("random"), -(-args.final_episodes // 10)),
        "search": (load_policy("search"), args.search_episodes),
        name: (best, args.final_episodes),
    }
    tables = [
        [
            evaluate(policy, player, **game, episodes=episodes)
            for player, (policy, episodes) in players.items()
            if episodes > 0
        ]
        for game in args.games
    ]
    scores = [score for table in tables for score in table]
    record = [dataclasses.asdict(score) for score in scores]
    write_json_report(folder / "scores.json", "stable-baselines3", "torch", scores=record)
    for table in tables:
        print_evaluations(table)
    return scores


def new_folder(args: Run) -> Path:
    """Make the run's folder and return it; another run, one begun at the same time included, is never overwritten.

    Raises:
        SystemExit: the folder asked for exists.
        OSError: it cannot be made.
    """
    if args.out is not None:
        try:
            args.out.mkdir(parents=True)
        except FileExistsError:
            raise SystemExit(f"out: expected a new folder, {args.out} exists; {_go_on(args.out)}") from None
        return args.out
    runs = Path("runs")
    runs.mkdir(exist_ok=True)
    for number in itertools.count(1):
        folder = runs / f"{Path(args.course).stem}-{number}"
        with contextlib.suppress(FileExistsError):
            folder.mkdir()
            break
    return folder


def read_args(kind: type[Args], folder: Path) -> Args:
    """Return the arguments that a run was started with.

    Raises:
        SystemExit: there is no run to go on with, its arguments cannot be read, or it is of another program.
    """
    if not (folder / "args.json").is_file():
        raise SystemExit(f"resume: expected the folder of a run, {folder} has no args.json.")
    try:
        stored = json.loads((folder / "args.json").read_text())
    except (OSError, ValueError) as error:
        raise SystemExit(
            f"resume: expected the arguments of a run in {folder / 'args.json'}, received {error}; begin a new run."
        ) from error
    if not isinstance(stored, dict) or stored.keys() != {field.name for field in dataclasses.fields(kind)}:
        raise SystemExit(f"resume: expected a run of this program, {folder} has the arguments of another.")
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()
    }
    return kind(**values)


def _go_on(folder: Path) -> str:
    return f"To go on with it: --resume {folder}"
