"""The PPO sample and what all samples share, on tiny budgets."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import pytest
import torch
from stable_baselines3 import PPO

from agents import train_ppo
from agents.run_evaluation import EvalCheckpointCallback
from agents.train_ppo import LogStdSchedule, PPOConfig
from agents.training_run import TrainConfig, create_run_folder, save_on_interrupt

TINY = PPOConfig(
    total_timesteps=256,
    n_envs=16,
    n_steps=4,
    batch_size=64,
    eval_freq=128,
    n_eval_episodes=2,
    n_test_episodes=2,
    n_search_episodes=0,
)


def test_run_learns_saves_and_evaluates(tmp_path: Path) -> None:
    """All time steps are used; checkpoint, best model, configuration and scores are stored; no run is overwritten."""
    folder = tmp_path / "run"
    scores = train_ppo.main(dataclasses.replace(TINY, out=folder))
    assert [score.policy for score in scores] == ["random", "PPO"]
    assert PPO.load(folder / "checkpoint.zip").num_timesteps == TINY.total_timesteps
    assert json.loads((folder / "scores.json").read_text())["scores"][1]["episodes"] == TINY.n_test_episodes
    assert {file.name for file in folder.iterdir()} >= {"best.zip", "config.json", "progress.json"}
    assert not [file for file in folder.iterdir() if file.name.startswith(".")], "temporary files are left"
    with pytest.raises(SystemExit, match="exists"):
        train_ppo.main(dataclasses.replace(TINY, out=folder))


def test_same_seed_gives_same_model_bitwise(tmp_path: Path) -> None:
    """Another seed gives another model."""
    weights = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        train_ppo.main(dataclasses.replace(TINY, out=tmp_path / name, seed=seed))
        policy = PPO.load(tmp_path / name / "checkpoint.zip").policy
        weights.append(torch.nn.utils.parameters_to_vector(policy.parameters()))
    assert torch.equal(weights[0], weights[1]) and not torch.equal(weights[0], weights[2])


def test_run_starts_from_given_weights(tmp_path: Path) -> None:
    """With a learning rate of zero a run ends with the weights that it starts from, whatever its seed."""
    train_ppo.main(dataclasses.replace(TINY, out=tmp_path / "a"))
    weights = tmp_path / "a" / "checkpoint.zip"
    train_ppo.main(dataclasses.replace(TINY, out=tmp_path / "b", seed=5, init_weights=weights, learning_rate=0.0))
    before, after = (PPO.load(path / "checkpoint.zip").policy.state_dict() for path in (tmp_path / "a", tmp_path / "b"))
    assert all(torch.equal(before[name], after[name]) for name in before)
    with pytest.raises(SystemExit, match="init_weights"):
        train_ppo.main(dataclasses.replace(TINY, out=tmp_path / "c", init_weights=tmp_path / "none.zip"))


def test_annealed_noise_follows_linear_schedule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The noise depends on the time steps alone; each rollout is played with the noise of its start."""
    observed: list[tuple[int, float]] = []

    class RecordingSchedule(LogStdSchedule):
        def _on_step(self) -> bool:
            observed.append((self.num_timesteps, float(self.log_std[0])))
            return True

    monkeypatch.setattr(train_ppo, "LogStdSchedule", RecordingSchedule)
    config = dataclasses.replace(TINY, total_timesteps=128, log_std_init=-1.0, log_std_final=-3.0)
    train_ppo.main(dataclasses.replace(config, anneal_std=True, out=tmp_path / "run"))
    assert {log_std for timesteps, log_std in observed if timesteps <= 64} == {-1.0}
    assert {log_std for timesteps, log_std in observed if timesteps > 64} == {-2.0}


@pytest.mark.parametrize(
    ("mean_strokes", "max_runs", "expected_seeds"),
    [
        ((1.0,), 3, [5]),
        ((1.09,), 3, [5]),
        ((1.3, 1.0), 3, [5, 6]),
        ((1.3, 1.3, 1.3, 1.0), 3, [5, 6, 7]),
        ((1.3,), 1, [5]),
    ],
)
def test_stuck_run_is_followed_by_next_seed(
    mean_strokes: tuple[float, ...],
    max_runs: int,
    expected_seeds: list[int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each run has the next seed and its own folder, until one comes close to search or ``max_runs`` is reached."""
    configs: list[PPOConfig] = []

    def fake_main(config: PPOConfig) -> list[Any]:
        configs.append(config)
        strokes = {"random": 9.0, "search": 1.0, "PPO": mean_strokes[len(configs) - 1]}
        return [SimpleNamespace(policy=policy, strokes=mean) for policy, mean in strokes.items()]

    monkeypatch.setattr(train_ppo, "main", fake_main)
    scores = train_ppo.train_until_learned(PPOConfig(seed=5, max_runs=max_runs, out=tmp_path / "run"))
    assert [config.seed for config in configs] == expected_seeds
    assert scores[-1].strokes == mean_strokes[len(expected_seeds) - 1]
    assert len({config.out for config in configs}) == len(expected_seeds)


def test_several_runs_need_search() -> None:
    """Without search nothing shows that a run got stuck, so the arguments are rejected before the first run."""
    with pytest.raises(SystemExit, match="max_runs: expected 1 without search"):
        train_ppo.train_until_learned(PPOConfig(max_runs=2, n_search_episodes=0))


def test_rejects_zero_runs() -> None:
    """At least one run is expected."""
    with pytest.raises(SystemExit, match="max_runs: expected at least 1"):
        train_ppo.train_until_learned(PPOConfig(max_runs=0))


def test_interrupted_run_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C saves; --resume uses exactly the time steps that remain, with the stored configuration."""
    folder = tmp_path / "run"

    def interrupt(callback: EvalCheckpointCallback) -> bool:
        if callback.num_timesteps >= TINY.total_timesteps / 2:
            raise KeyboardInterrupt
        return True

    with monkeypatch.context() as patched:
        patched.setattr(EvalCheckpointCallback, "_on_step", interrupt)
        with pytest.raises(SystemExit, match="--resume"):
            train_ppo.main(dataclasses.replace(TINY, out=folder))
    interrupted_at = PPO.load(folder / "checkpoint.zip").num_timesteps
    assert TINY.total_timesteps / 2 <= interrupted_at < TINY.total_timesteps
    train_ppo.main(PPOConfig(resume=folder))
    model = PPO.load(folder / "checkpoint.zip")
    assert model.num_timesteps == TINY.total_timesteps and model.n_envs == TINY.n_envs


class PickledTrap:
    """Object that creates a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the function that unpickling calls, and its arguments."""
        return Path.touch, (self.path,)


def test_resuming_runs_no_pickled_code(tmp_path: Path) -> None:
    """Code pickled in the checkpoint or the best model does not run; stable-baselines3's own ``load`` runs it."""
    folder = tmp_path / "run"
    created_file = tmp_path / "created"
    train_ppo.main(dataclasses.replace(TINY, out=folder))
    for file in (folder / "checkpoint.zip", folder / "best.zip"):
        with zipfile.ZipFile(file) as archive:
            entries = {name: archive.read(name) for name in archive.namelist()}
        data = json.loads(entries["data"])
        pickled = base64.b64encode(pickle.dumps(PickledTrap(created_file))).decode()
        data["trap"] = {":type:": "trap", ":serialized:": pickled}
        with zipfile.ZipFile(file, "w") as archive:
            for name, content in {**entries, "data": json.dumps(data)}.items():
                archive.writestr(name, content)
    train_ppo.main(PPOConfig(resume=folder))
    assert not created_file.exists()
    PPO.load(folder / "best.zip")
    assert created_file.exists()


def test_rejects_resuming_folder_without_run(tmp_path: Path) -> None:
    """The program ends with one line."""
    with pytest.raises(SystemExit, match="resume"):
        train_ppo.main(PPOConfig(resume=tmp_path))


@pytest.mark.parametrize("text", ["{", "[]", "\xff"], ids=str)
def test_rejects_resuming_damaged_configuration(tmp_path: Path, text: str) -> None:
    """The program ends with one line."""
    (tmp_path / "config.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(SystemExit, match=r"resume: expected .*run"):
        train_ppo.main(PPOConfig(resume=tmp_path))


def accept_any_model(config: TrainConfig, folder: Path | None) -> None:
    """Accept any model."""


@pytest.mark.parametrize(
    ("invalid", "message"),
    [
        ({"course": "dogleggy"}, "did you mean 'dogleg'"),
        ({"difficulty": "medium"}, "difficulty"),
        ({"reward": "none"}, "reward"),
        ({"n_test_episodes": 0}, "n_test_episodes"),
        ({"n_eval_episodes": 0}, "n_eval_episodes"),
        ({"course": "procedural", "num_levels": 1_000_001}, "num_levels: expected 1 to 1000000"),
        ({"course": "procedural", "num_levels": 501, "eval_seed": 500}, "num_levels: expected 1 to 500"),
        ({"eval_seed": 1_000_001}, "eval_seed"),
        ({"eval_seed": 999_999}, "eval_seed"),
        ({"eval_seed": 1_999_999}, "eval_seed"),
    ],
    ids=str,
)
def test_invalid_arguments_create_no_folder(invalid: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Arguments are checked before anything is written."""
    with pytest.raises(SystemExit, match=message):
        train_ppo.main(dataclasses.replace(TINY, **invalid, out=tmp_path / "run"))
    assert not list(tmp_path.iterdir())


def test_simultaneous_runs_get_different_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The slower of two programs takes the next free name if the other one has just created its folder."""
    monkeypatch.chdir(tmp_path)
    replace = Path.replace

    def replace_too_late(path: Path, target: Path) -> Path:
        if target.name == "dogleg-1":
            target.mkdir()
            (target / "config.json").touch()
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", replace_too_late)
    assert create_run_folder(TINY) == Path("runs/dogleg-2")
    assert sorted(path.name for path in Path("runs").iterdir()) == ["dogleg-1", "dogleg-2"]


@pytest.mark.parametrize("moment", ["mkdir", "write_text", "replace"])
def test_run_that_is_killed_while_its_folder_is_made_leaves_none(
    moment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run folder appears with its configuration in it, so that the run can be resumed, or it does not appear."""
    method = getattr(Path, moment)

    def die(path: Path, *args: Any, **options: Any) -> None:
        if path.parent == tmp_path or path.parent.parent == tmp_path:
            raise KeyboardInterrupt
        method(path, *args, **options)

    config = dataclasses.replace(TINY, out=tmp_path / "run")
    monkeypatch.setattr(Path, moment, die)
    with pytest.raises(KeyboardInterrupt):
        create_run_folder(config)
    monkeypatch.undo()
    assert not (tmp_path / "run").exists()
    assert json.loads((create_run_folder(config) / "config.json").read_text())["course"] == "dogleg"


INVALID_NUMBERS = [
    ("n_envs", 0),
    ("batch_size", 0),
    ("batch_size", 1),
    ("seed", -1),
    ("seed", 2**40),
    ("gamma", math.nan),
    ("gamma", 1.5),
    ("learning_rate", -1e-3),
    ("learning_rate", math.inf),
    ("total_timesteps", 0),
    ("eval_freq", 0),
    ("n_epochs", 0),
    ("n_steps", -3),
    ("clip_range", 0.0),
    ("log_std_init", math.nan),
    ("net_arch", (64, 0)),
    ("n_search_episodes", -1),
]


@pytest.mark.parametrize(("name", "value"), INVALID_NUMBERS)
def test_number_out_of_its_range_is_named_before_anything_is_made(name: str, value: Any, tmp_path: Path) -> None:
    """One line names the argument and its range, and no folder is left."""
    config = dataclasses.replace(TINY, out=tmp_path / "run", **{name: value})
    with pytest.raises(SystemExit, match=f"^{name}: expected a number "):
        train_ppo.main(config)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [b"", b"not a model", b"PK\x03\x04 truncated"])
def test_faulty_initial_weights_leave_no_folder(content: bytes, tmp_path: Path) -> None:
    """The same folder can be used once the argument is right."""
    weights = tmp_path / "weights.zip"
    weights.write_bytes(content)
    with pytest.raises(SystemExit, match=r"^init_weights: expected an intact model"):
        train_ppo.main(dataclasses.replace(TINY, out=tmp_path / "run", init_weights=weights))
    assert list(tmp_path.iterdir()) == [weights]


def test_initial_weights_of_another_observation_leave_no_folder(tmp_path: Path) -> None:
    """A model that was trained on other inputs is an error before the folder is made."""
    envs = gym.make("MiniGolf-v0", observation="rays")
    PPO("MlpPolicy", envs, policy_kwargs={"net_arch": list(TINY.net_arch)}).save(tmp_path / "rays.zip")
    with pytest.raises(SystemExit, match=r"^init_weights: expected an intact model of this program and observation"):
        train_ppo.main(dataclasses.replace(TINY, out=tmp_path / "run", init_weights=tmp_path / "rays.zip"))
    assert not (tmp_path / "run").exists()


DAMAGES: dict[str, Callable[[Path], object]] = {
    "no configuration": lambda run: (run / "config.json").unlink(),
    "empty configuration": lambda run: (run / "config.json").write_text(""),
    "truncated configuration": lambda run: (run / "config.json").write_text('{"course": "dogl'),
    "configuration of another program": lambda run: (run / "config.json").write_text("{}"),
    "configuration that is a list": lambda run: (run / "config.json").write_text("[1]"),
    "number as text": lambda run: change_config(run, n_envs="many"),
    "number out of range": lambda run: change_config(run, gamma=7.0),
    "unknown course": lambda run: change_config(run, course="doglegg"),
    "other observation": lambda run: change_config(run, observation="rays"),
    "other network": lambda run: change_config(run, net_arch=[3]),
    "empty checkpoint": lambda run: (run / "checkpoint.zip").write_bytes(b""),
    "truncated checkpoint": lambda run: truncate(run / "checkpoint.zip"),
    "truncated best model": lambda run: truncate(run / "best.zip"),
    "no best model": lambda run: (run / "best.zip").unlink(),
    "truncated evaluations": lambda run: truncate(run / "progress.json"),
    "evaluations of another kind": lambda run: (run / "progress.json").write_text('[{"score": 1}]'),
}
"""Ways to damage a run folder."""


def change_config(run: Path, **changes: Any) -> None:
    """Change arguments in the stored configuration of a run."""
    path = run / "config.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def truncate(path: Path) -> None:
    """Cut a file in half."""
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


@pytest.fixture(scope="module")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a tiny run."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    train_ppo.main(dataclasses.replace(TINY, out=folder, n_test_episodes=1, n_search_episodes=0))
    return folder


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_run_folder_ends_with_one_line_and_stays_as_it_is(
    damage: str, finished_run: Path, tmp_path: Path
) -> None:
    """--resume checks all that it needs before it changes anything."""
    run = tmp_path / "run"
    shutil.copytree(finished_run, run)
    DAMAGES[damage](run)
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    with pytest.raises(SystemExit) as stop:
        train_ppo.main(PPOConfig(resume=run))
    assert isinstance(stop.value.code, str) and "\n" not in stop.value.code and "expected" in stop.value.code
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_interrupt_on_full_disk_ends_with_one_line(tmp_path: Path) -> None:
    """The message says that the checkpoint could not be saved."""

    def save() -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(SystemExit, match=r"Could not save: .*No space.*--resume"), save_on_interrupt(tmp_path, save):
        raise KeyboardInterrupt
