"""Turn the best model of a training run into a pretrained model of the package, "ppo" or "generalist".

For the run runs/dogleg-1 it writes minigolf_env/players/pretrained/dogleg.npz and its model card dogleg.json: training
command, scores and SHA-256. For a run of train_generalist the files are procedural.npz and procedural.json.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from agents.command_line import run_program
from agents.config_check import check_ranges, one_line_errors
from agents.train_generalist import GeneralistConfig
from agents.train_ppo import PPOConfig
from agents.training_run import TrainConfig, read_config, validate_config
from minigolf_env._atomic_io import atomic_write, check_output
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.evaluation.report import print_evaluations, write_json_report
from minigolf_env.players.model_files import load_model, save_model
from minigolf_env.players.policies import PRETRAINED_FOLDER, PRETRAINED_MODELS, ModelPolicy

MAX_PRETRAINED_BYTES = 200_000
"""Maximum size of a model's file, as everyone who installs the package downloads it."""


@dataclass(frozen=True)
class ReleaseConfig:
    """Command-line arguments of this program."""

    run: Annotated[Path, tyro.conf.Positional]
    """Run folder."""
    folder: Path = PRETRAINED_FOLDER
    """Folder for the model and its card."""
    n_episodes: int = 1000
    """Number of episodes of each score on the card."""
    putt_noise: tuple[float, float] = (0.5, 0.015)
    """Putt noise of the second score of each environment; the first has none. Standard deviations as in TrainConfig."""


def training_command(name: str, config: TrainConfig) -> str:
    """Return the command line of program train_NAME for a configuration, without arguments that have their default."""
    words = [f"python -m agents.train_{name}"]
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        option = field.name.replace("_", "-")
        if value == field.default or field.name in ("out", "resume"):
            continue
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        else:
            words.append(f"--{option} " + " ".join(map(str, value if isinstance(value, tuple) else (value,))))
    return " ".join(words)


def main(config: ReleaseConfig) -> None:
    """Write the model and its card, and print its scores.

    Raises:
        SystemExit: an argument is invalid, or the folder holds no model of a run; the message is one line.
    """
    is_generalist = (config.run / "best.npz").is_file()
    name = "generalist" if is_generalist else "ppo"
    run_config: TrainConfig = read_config(GeneralistConfig if is_generalist else PPOConfig, config.run, "run")
    validate_config(run_config)
    validate_config(dataclasses.replace(run_config, putt_noise=config.putt_noise))
    try:
        check_ranges(config)
        model_path = check_output(config.folder / PRETRAINED_MODELS[name], "folder")
    except (OSError, ValueError) as error:
        raise SystemExit(str(error)) from None
    with one_line_errors("run: expected an intact model"):
        model = load_model(config.run / ("best.npz" if is_generalist else "best.zip"))

    # Write the model to a temporary file: the present one stays until the new one is evaluated.
    with atomic_write(model_path) as temporary_file:
        # The generalist has 18 times as many weights, so it is stored in half precision.
        save_model(model, temporary_file, np.float16 if is_generalist else np.float32)
        size = temporary_file.stat().st_size
        if size > MAX_PRETRAINED_BYTES:
            raise SystemExit(
                f"model: expected at most {MAX_PRETRAINED_BYTES:,} bytes, received {size:,}; train a smaller network."
            )

        # Evaluate it in each environment, without putt noise and with it.
        policy = ModelPolicy(temporary_file)
        noises: list[dict[str, Any]] = [{"putt_noise": (0.0, 0.0)}, {"putt_noise": config.putt_noise}]
        eval_env_args = [{**env_args, **noise} for env_args in run_config.eval_env_args for noise in noises]
        scores = [evaluate(policy, name, **env_args, episodes=config.n_episodes) for env_args in eval_env_args]

    # Print the scores and write the card.
    for score in scores:
        print_evaluations([score])
    write_json_report(
        model_path.with_suffix(".json"),
        "stable-baselines3",
        "torch",
        command=training_command(name, run_config),
        observation=policy.observation,
        sha256=policy.sha256,
        scores=[dataclasses.asdict(score) for score in scores],
    )


if __name__ == "__main__":
    run_program(main, ReleaseConfig, __doc__)
