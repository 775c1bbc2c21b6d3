"""The programs of docs/clients.md and docs/examples run and do what the page says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from agents.train_ppo import PPOConfig
from docs.examples import cleanrl_ppo
from tests.markdown import blocks

DOCS = Path(__file__).parents[2] / "docs"
BLOCKS = [block.code for block in blocks(DOCS / "clients.md", "python")]
PROCESSES = next(block for block in BLOCKS if "forkserver" in block)
TINY = {"putts": 256, "num_envs": 16, "num_steps": 2, "epochs": 2, "batch": 16}


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("number", [number for number, block in enumerate(BLOCKS) if block != PROCESSES])
def test_code_block_of_the_page_runs(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By itself, without a warning."""
    monkeypatch.chdir(tmp_path)
    exec(BLOCKS[number], {"__name__": "__main__"})  # noqa: S102 (our own page)
    if "RecordVideo" in BLOCKS[number]:
        assert len(list(tmp_path.rglob("*.mp4"))) == 2


def test_page_has_a_block_for_each_library() -> None:
    """Wrappers, their vector versions, videos, processes, the checker, stable-baselines3 in two ways."""
    names = (
        "FrameStackObservation",
        "wrappers.vector import Norm",
        "tile_sequences",
        "forkserver",
        "check_env",
        '"MiniGolf-v0", n_',
        "VecMon",
    )
    assert [next(i for i, block in enumerate(BLOCKS) if name in block) for name in names] == list(range(len(BLOCKS)))


def test_process_block_runs_as_a_program(gl: None, tmp_path: Path) -> None:
    """Each new process imports the file, and starts no further processes."""
    (tmp_path / "program.py").write_text(PROCESSES)
    subprocess.run([sys.executable, "program.py"], cwd=tmp_path, check=True, timeout=600)


def test_single_file_ppo_plays_all_its_putts(capsys: pytest.CaptureFixture[str]) -> None:
    """It prints the progress after each tenth of them, or each update if there are fewer."""
    shares = cleanrl_ppo.main(cleanrl_ppo.Args(**TINY))
    assert len(shares) == 8 and all(0.0 <= share <= 1.0 for share in shares)
    assert capsys.readouterr().out.splitlines()[-1].startswith("     256 putts")


def update(clip: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the move (2,) of the mean putt if putts to the right are better, and the values before and after."""
    torch.manual_seed(0)
    agent, std = cleanrl_ppo.Agent(10, 2), 0.2
    optimizer = torch.optim.Adam(agent.parameters(), 1e-3)
    seen = torch.rand(256, 10)
    with torch.no_grad():
        putt, value = agent(seen, std)
        putts = putt.sample()
        data = [seen, putts, putt.log_prob(putts).sum(-1), putts[:, 0], torch.ones(256)]
    cleanrl_ppo.update(agent, optimizer, data, std, cleanrl_ppo.Args(batch=64, epochs=20, clip=clip))
    with torch.no_grad():
        after, worth = agent(seen, std)
    return (after.mean - putt.mean).mean(0), value, worth


def test_update_moves_toward_better_putts() -> None:
    """The mean putt moves to the right, and the values to the returns, which are 1."""
    moved, before, after = update(clip=0.2)
    assert moved[0] > 0.01 and moved[0] > 2 * abs(moved[1])
    assert (after - 1).square().mean() < (before - 1).square().mean()


def test_update_moves_further_with_a_wider_clip() -> None:
    """For three widths."""
    near, middle, far = (update(clip)[0][0] for clip in (0.01, 0.2, 100.0))
    assert 2 * near < middle and 2 * middle < far


def test_advantages_equal_their_definition() -> None:
    """Sums of discounted errors of the values, up to the end of an episode."""
    rng, args = np.random.default_rng(0), cleanrl_ppo.Args(gamma=0.7, gae_lambda=0.6)
    rewards, values = torch.as_tensor(rng.normal(size=(6, 3))), torch.as_tensor(rng.normal(size=(7, 3)))
    over = torch.as_tensor(rng.random((6, 3)) < 0.3).double()
    found = cleanrl_ppo.advantages(rewards, values, over, args)
    for n in range(3):
        for t in range(6):
            total, weight = 0.0, 1.0
            for k in range(t, 6):
                total += weight * (rewards[k, n] + 0.7 * (1 - over[k, n]) * values[k + 1, n] - values[k, n])
                weight *= 0.7 * 0.6 * (1 - over[k, n])
            assert float(found[t, n]) == pytest.approx(float(total))


def test_zoo_settings_equal_those_of_train_ppo() -> None:
    """By their names; environments times steps make an update of the same size."""
    text = (DOCS / "examples" / "zoo" / "ppo.yml").read_text()
    settings = dict(re.findall(r"^  (\w+): (.+)$", text, flags=re.MULTILINE))
    config = PPOConfig()
    for name in ("batch_size", "n_epochs", "gamma", "gae_lambda", "target_kl"):
        assert float(settings[name]) == getattr(config, name), name
    assert settings["learning_rate"] == f"lin_{config.learning_rate:.0e}".replace("e-0", "e-")
    assert int(settings["n_envs"]) * int(settings["n_steps"]) == config.n_envs * config.n_steps
    assert float(settings["n_timesteps"].removeprefix("!!float ")) == config.total_timesteps
    assert settings["policy_kwargs"] == f"dict(net_arch={list(config.net_arch)}, log_std_init={config.log_std_init})"
    assert not config.anneal_std and "callback" not in text


def test_zoo_trains(tmp_path: Path) -> None:
    """With the command of the page and few putts, where the zoo is installed."""
    pytest.importorskip("rl_zoo3", reason="docs/clients.md says how to install it, into an environment of its own")
    command = [sys.executable, "-m", "rl_zoo3.train", "--algo", "ppo", "--env", "MiniGolf-v0"]
    command += ["--gym-packages", "minigolf_env", "--conf-file", str(DOCS / "examples" / "zoo" / "ppo.yml")]
    command += ["--log-folder", str(tmp_path), "--eval-episodes", "1", "--eval-freq", "2048", "-n", "2048"]
    subprocess.run(command, cwd=DOCS.parent, check=True, timeout=300)
    assert (tmp_path / "ppo" / "MiniGolf-v0_1" / "best_model.zip").is_file()
