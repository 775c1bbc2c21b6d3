"""Make the best model of a training run the one that ships with the package, "ppo".

``python -m agents.ship runs/dogleg-1`` writes minigolf_env/models/dogleg.npz, and beside it a card, dogleg.json: how it
was trained, what it scores, and its SHA-256.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from agents.runs import read_args
from agents.train_ppo import Args as TrainArgs
from minigolf_env.evaluation import evaluate, print_scores
from minigolf_env.files import writing
from minigolf_env.network import read_network
from minigolf_env.policies import SHIPPED, ModelPolicy
from minigolf_env.scoring import write_record

LARGEST = 200_000
"""What a model may weigh that everyone installs, bytes."""


@dataclass(frozen=True)
class Args:
    """The command line."""

    run: Annotated[Path, tyro.conf.Positional]
    """The folder of a training run."""
    output: Path = SHIPPED
    """The model's file, .npz."""
    episodes: int = 1000
    noise: tuple[float, float] = (0.5, 0.015)
    """The second score on the card is under this noise: standard deviations of direction (degrees) and speed."""


def command(args: TrainArgs) -> str:
    """Return the command line that trains with some arguments."""
    words = ["python -m agents.train_ppo"]
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
    trained = read_args(TrainArgs, args.run)
    with writing(args.output) as part:  # The model that shipped before stays until this one is scored.
        read_network(args.run / "best.zip").save(part)
        size = part.stat().st_size
        if size > LARGEST:
            raise SystemExit(f"model: expected at most {LARGEST:,} bytes, received {size:,}; train a smaller network.")
        policy = ModelPolicy(part)
        game: dict[str, Any] = {"course": trained.course, "difficulty": trained.difficulty, "episodes": args.episodes}
        scores = [evaluate(policy, "ppo", **game, putt_noise=noise) for noise in ((0.0, 0.0), args.noise)]
    for score in scores:
        print_scores([score])
    write_record(
        args.output.with_suffix(".json"),
        "stable-baselines3",
        "torch",
        command=command(trained),
        observation=policy.observation,
        sha256=policy.sha256,
        scores=[dataclasses.asdict(score) for score in scores],
    )


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
