"""Make the best model of a training run the one that ships with the package: "ppo", or "generalist".

``python -m agents.release_model runs/dogleg-1`` writes minigolf_env/players/pretrained/dogleg.npz and its card,
dogleg.json: how it was trained, what it scores, and its SHA-256. Of a run of train_generalist it is procedural.npz.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from agents import runs, train_generalist, train_ppo
from minigolf_env._atomic_io import atomic_write
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.evaluation.report import print_evaluations, write_json_report
from minigolf_env.players.model_files import load_model, save_model
from minigolf_env.players.policies import PRETRAINED_FOLDER, PRETRAINED_MODELS, ModelPolicy

LARGEST = 200_000
"""What a model may weigh that everyone installs, bytes."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    run: Annotated[Path, tyro.conf.Positional]
    """The folder of a training run."""
    folder: Path = PRETRAINED_FOLDER
    """Where the model and its card go."""
    episodes: int = 1000
    noise: tuple[float, float] = (0.5, 0.015)
    """The second score on the card is under this noise: standard deviations of direction (degrees) and speed."""


def command(name: str, args: runs.Run) -> str:
    """Return the command line of the program train_NAME that trains with some arguments."""
    words = [f"python -m agents.train_{name}"]
    for field in dataclasses.fields(args):
        value, flag = getattr(args, field.name), field.name.replace("_", "-")
        if value == field.default or field.name in ("out", "resume"):
            continue
        if isinstance(value, bool):
            words.append(f"--{flag}" if value else f"--no-{flag}")
        else:
            words.append(f"--{flag} " + " ".join(map(str, value if isinstance(value, tuple) else (value,))))
    return " ".join(words)


def main(args: Args) -> None:
    """Write the model and its card, and print its scores."""
    judges = (args.run / "best.npz").is_file()
    name = "generalist" if judges else "ppo"
    trained: runs.Run = runs.read_args(train_generalist.Args if judges else train_ppo.Args, args.run)
    file = args.folder / PRETRAINED_MODELS[name]
    with atomic_write(file) as part:  # The model that shipped before stays until this one is scored.
        # A judge, which has ten times the weights, is rounded.
        model = load_model(args.run / ("best.npz" if judges else "best.zip"))
        save_model(model, part, np.float16 if judges else np.float32)
        size = part.stat().st_size
        if size > LARGEST:
            raise SystemExit(f"model: expected at most {LARGEST:,} bytes, received {size:,}; train a smaller network.")
        policy = ModelPolicy(part)
        noises: list[dict[str, Any]] = [{"putt_noise": (0.0, 0.0)}, {"putt_noise": args.noise}]
        games = [{**game, **noise} for game in trained.games for noise in noises]
        scores = [evaluate(policy, name, **game, episodes=args.episodes) for game in games]
    for score in scores:
        print_evaluations([score])
    write_json_report(
        file.with_suffix(".json"),
        "stable-baselines3",
        "torch",
        command=command(name, trained),
        observation=policy.observation,
        sha256=policy.sha256,
        scores=[dataclasses.asdict(score) for score in scores],
    )


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
