"""The sample programs on tiny budgets: each learns something, saves it, and scores it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from agents import runs, train_generalist, train_pixels, train_ppo, train_sac
from minigolf_env.evaluation.evaluate import evaluate
from minigolf_env.players.model_files import load_model
from minigolf_env.players.policies import ModelPolicy
from minigolf_env.players.putt_features import NUM_FEATURES
from minigolf_env.players.putt_value_model import PuttValueModel

TINY: dict[str, Any] = {
    "putts": 64,
    "num_envs": 8,
    "check_every": 32,
    "check_episodes": 2,
    "final_episodes": 2,
    "search_episodes": 0,
}


@pytest.mark.parametrize(
    ("program", "more"),
    [
        (train_ppo, {"n_steps": 4, "batch_size": 16, "reward": "strokes", "putt_noise": (0.5, 0.015)}),
        (train_sac, {"learning_starts": 16, "gradient_steps": 1, "batch_size": 8}),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_sample_runs(program: Any, more: dict[str, Any], tmp_path: Path) -> None:
    """All its putts are played, weights move, and the best model's score ends the run."""
    folder = tmp_path / "run"
    scores = program.main(program.Args(out=folder, **TINY, **more))
    history = json.loads((folder / "progress.json").read_text())
    assert history[-1]["putts"] >= TINY["putts"] and len(history) >= 2
    assert scores[-1].policy == ("SAC" if program is train_sac else "PPO") and scores[-1].episodes == 2
    assert (folder / "best.zip").is_file()
    other: Any = train_ppo if program in (train_sac, train_pixels) else train_sac
    with pytest.raises(SystemExit, match="of another"):
        other.main(other.Args(resume=folder))


def test_the_sample_on_pictures_runs(gl: None, tmp_path: Path) -> None:
    """As the others do, where pictures can be drawn."""
    test_a_sample_runs(train_pixels, {"n_steps": 4, "batch_size": 16}, tmp_path)


SMALL_GENERALIST: dict[str, Any] = {**TINY, "num_envs": 2, "tries": 8, "num_levels": 3, "memory": 50, "batch_size": 16}


def test_the_generalist_runs(tmp_path: Path) -> None:
    """It learns to tell putts apart, is scored on each difficulty, and its file alone plays as it did."""
    folder = tmp_path / "run"
    scores = train_generalist.main(train_generalist.Args(out=folder, **{**SMALL_GENERALIST, "putts": 672}))
    history = json.loads((folder / "progress.json").read_text())
    assert history[-1]["putts"] == 672 and len(history) > 2
    assert [(score.policy, score.difficulty) for score in scores[1::2]] == [
        ("generalist", "easy"),
        ("generalist", "medium"),
    ]
    policy = ModelPolicy(folder / "best.npz")
    assert policy.observation == "bounce_rays" and isinstance(policy.model, PuttValueModel)
    assert policy.model.mlp.num_inputs == NUM_FEATURES
    score = evaluate(policy, "generalist", "procedural", difficulty="easy", episodes=2, quiet=True)
    assert dataclasses.replace(score, sha256=None) == dataclasses.replace(scores[1], sha256=None)
    with pytest.raises(SystemExit, match="of another"):
        train_ppo.main(train_ppo.Args(resume=folder))


def test_the_generalist_goes_on(tmp_path: Path) -> None:
    """From its last checkpoint, to the bit as it was saved; a new run may begin with its weights."""
    args = train_generalist.Args(out=tmp_path / "a", **SMALL_GENERALIST)
    train_generalist.main(args)
    again = train_generalist.Training(args, tmp_path / "a")
    assert again.putts == 96 and len(again.progress.history) == 3
    stored = load_model(tmp_path / "a" / "checkpoint.npz")
    begun = train_generalist.Training(
        dataclasses.replace(args, seed=1, start=tmp_path / "a" / "checkpoint.npz"), tmp_path
    )
    for judge in (again.judge, begun.judge):
        for layer, other in zip(judge.mlp.layers, stored.mlp.layers, strict=True):
            assert all(np.array_equal(one, two) for one, two in zip(layer, other, strict=True))


def test_a_seed_gives_the_same_generalist(tmp_path: Path) -> None:
    """Bit for bit, though it plays while it learns; another seed gives another."""
    models = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        folder = tmp_path / name
        folder.mkdir()
        training = train_generalist.Training(train_generalist.Args(seed=seed, **SMALL_GENERALIST), folder)
        training.run()
        training.keep("model.npz")
        models.append((folder / "model.npz").read_bytes())
    assert models[0] == models[1] != models[2]


def test_a_judge_learns_which_putts_hole_out(tmp_path: Path) -> None:
    """After some putts on one level, those that holed out are judged likelier to than others."""
    args = train_generalist.Args(
        **{**SMALL_GENERALIST, "num_envs": 8, "memory": 20_000, "reuse": 4.0, "batch_size": 128, "num_levels": 1},
        difficulties=("easy",),
    )
    training = train_generalist.Training(dataclasses.replace(args, putts=1_000_000), tmp_path)
    for _ in range(100):
        training.memory.add(*training.play(training.judge))
        training.learn(4)
    sights, targets = training.play(training.judge)
    likely, holed = training.net(torch.from_numpy(sights))[:, 0].detach().numpy(), targets[:, 0] > 0.0
    assert holed.any() and likely[holed].mean() > likely[~holed].mean() + 1.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"reward": "strokes"}, "shaped"),
        ({"observation": "rays"}, "bounce_rays"),
        ({"difficulties": ("soft",)}, "difficulty"),
        ({"difficulty": "hard"}, "--difficulties"),
    ],
    ids=str,
)
def test_the_generalist_says_what_is_wrong(wrong: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Before anything is made."""
    with pytest.raises(SystemExit, match=message):
        train_generalist.main(train_generalist.Args(**{**SMALL_GENERALIST, **wrong}, out=tmp_path / "run"))
    assert not list(tmp_path.iterdir())


def test_a_seed_gives_the_same_model(tmp_path: Path) -> None:
    """Bit for bit; another seed gives another."""
    args = train_ppo.Args(**TINY, n_steps=4, batch_size=16)
    weights = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        train_ppo.main(dataclasses.replace(args, out=tmp_path / name, seed=seed))
        policy = PPO.load(tmp_path / name / "checkpoint.zip").policy
        weights.append(torch.nn.utils.parameters_to_vector(policy.parameters()))
    assert torch.equal(weights[0], weights[1]) and not torch.equal(weights[0], weights[2])


def test_a_run_can_start_from_a_model(tmp_path: Path) -> None:
    """With a learning rate of zero it ends with the weights it began with, whatever its seed."""
    args = train_ppo.Args(**TINY, n_steps=4, batch_size=16)
    train_ppo.main(dataclasses.replace(args, out=tmp_path / "a"))
    start = tmp_path / "a" / "checkpoint.zip"
    train_ppo.main(dataclasses.replace(args, out=tmp_path / "b", seed=5, start=start, learning_rate=0.0))
    before, after = (PPO.load(path / "checkpoint.zip").policy.state_dict() for path in (tmp_path / "a", tmp_path / "b"))
    assert all(torch.equal(before[name], after[name]) for name in before)
    with pytest.raises(SystemExit, match="start"):
        train_ppo.main(dataclasses.replace(args, out=tmp_path / "c", start=tmp_path / "none.zip"))


def test_the_noise_narrows_on_its_way(tmp_path: Path) -> None:
    """From the first to the last, by the share of the putts that were played, whatever the updates say."""
    seen: list[tuple[float, float]] = []

    class Watch(train_ppo.Annealing):
        def _on_step(self) -> bool:
            seen.append((self.num_timesteps / self.putts, float(self.log_std[0])))
            return True

    args = train_ppo.Args(**TINY, n_steps=4, batch_size=16, log_std=(-1.0, -3.0), out=tmp_path / "run")
    runs.run(args, train_ppo.build, lambda args: [Watch(*args.log_std, args.putts)])
    # A rollout of 32 putts is played with the noise of its start.
    assert {noise for share, noise in seen if share <= 0.5} == {-1.0}
    assert {noise for share, noise in seen if share > 0.5} == {-2.0}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"course": "dogleggy"}, "did you mean 'dogleg'"),
        ({"difficulty": "medium"}, "difficulty"),
        ({"reward": "none"}, "reward"),
        ({"final_episodes": 0}, "final_episodes"),
        ({"course": "procedural", "num_levels": 3_000_000}, "num_levels"),
    ],
    ids=str,
)
def test_wrong_arguments_leave_no_folder(wrong: dict[str, Any], message: str, tmp_path: Path) -> None:
    """They are told before anything is made."""
    with pytest.raises(SystemExit, match=message):
        train_ppo.main(train_ppo.Args(**{**TINY, **wrong}, out=tmp_path / "run"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("program", [train_ppo, train_sac])
def test_a_resumed_run_plays_other_tees(program: Any, tmp_path: Path) -> None:
    """Not those it began with; and its log stays in its folder, wherever that is now."""
    seen: list[np.ndarray] = []

    class Watch(train_ppo.Annealing):
        def _on_training_start(self) -> None:
            seen.append(np.array(self.model._last_obs))

        def _on_rollout_start(self) -> None: ...

    small = {"n_steps": 4} if program is train_ppo else {"learning_starts": 16, "gradient_steps": 1}
    args = program.Args(**TINY, **small, batch_size=16, out=tmp_path / "a")
    for again in (args, dataclasses.replace(args, resume=tmp_path / "b")):
        runs.run(again, program.build, lambda _: [Watch(0.0, 0.0, 1)])
        if again is args:
            stored = json.loads((tmp_path / "a" / "args.json").read_text())
            (tmp_path / "a" / "args.json").write_text(json.dumps({**stored, "putts": 128}))
            (tmp_path / "a").rename(tmp_path / "b")
    assert len(seen) == 2 and not np.array_equal(*seen)
    assert not (tmp_path / "a").exists() and list((tmp_path / "b").glob("log_*"))
