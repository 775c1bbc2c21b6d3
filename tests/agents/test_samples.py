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
from agents.facing_vec_env import FacingVecEnv
from minigolf_env.facing import VIEW
from minigolf_env.policies import ModelPolicy

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
        (train_generalist, {"n_steps": 2, "batch_size": 16, "num_levels": 3}),
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


def test_the_generalist_is_scored_as_it_learned(tmp_path: Path) -> None:
    """Its model faces the cup: the file alone plays as the learner did."""
    folder = tmp_path / "run"
    settings = {"n_steps": 2, "batch_size": 16, "num_levels": 3}
    train_generalist.main(train_generalist.Args(out=folder, **TINY, **settings))  # type: ignore[arg-type]
    policy = ModelPolicy(folder / "best.zip")
    assert policy.observation == "rays" and policy.network.inputs == VIEW


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
    args = train_ppo.Args(**TINY, n_steps=4, batch_size=16, anneal=False)
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


def test_facing_turns_what_stable_baselines3_sees() -> None:
    """Each environment's view, and the last one of an episode; a putt along x goes to the cup."""
    args = train_generalist.Args(**TINY, course="straight", difficulty=None, num_levels=None)
    envs = runs.make_envs(args)
    assert isinstance(envs.venv, FacingVecEnv)
    first = np.asarray(envs.reset())
    assert first.shape == (8, VIEW) and envs.observation_space.shape == (VIEW,)
    ahead = np.tile(np.array([[0.1, 0.0]], np.float32), (8, 1))
    after = np.asarray(envs.step(ahead)[0])
    assert (after[:, 1] < first[:, 1]).all(), "closer to the cup"
    for _ in range(9):
        *_, dones, infos = envs.step(0.0 * ahead)
    assert dones.all() and all(info["terminal_observation"].shape == (VIEW,) for info in infos)
    envs.close()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"course": "dogleggy"}, "did you mean 'dogleg'"),
        ({"difficulty": "medium"}, "difficulty"),
        ({"reward": "none"}, "reward"),
        ({"facing": True}, "rays"),
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
