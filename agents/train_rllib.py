"""Train Ray RLlib's PPO on a hole, on the cores of one machine or of many, and end with a table: random, search, PPO.

``python -m agents.train_rllib`` starts Ray on this machine, ``--address auto`` joins the cluster that this machine is a
node of; ``--resume runs/dogleg-1`` goes on after an interruption. docs/scaling.md has the commands for a cluster. The
best model is a file that stable-baselines3 loads: ``minigolf`` and ``agents.evaluate`` read it without Ray.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
import tyro
from rich.console import Console
from stable_baselines3 import PPO
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from agents import evaluate, train_ppo
from agents.cluster import connect
from minigolf_env.courses import load_course
from minigolf_env.policies import ModelPolicy

CONSOLE = Console()

ENVIRONMENT = "minigolf_env:MiniGolf-v0"
"""With the module's name: a worker on another node has imported nothing of ours."""

MODULE = "default_policy"
"""What RLlib calls its one network."""

NAMES = {
    "encoder.actor_encoder.net.mlp.": "mlp_extractor.policy_net.",
    "encoder.critic_encoder.net.mlp.": "mlp_extractor.value_net.",
    "pi.net.mlp.0.": "action_net.",
    "vf.net.mlp.0.": "value_net.",
    "pi.log_std": "log_std",
}
"""How the names of RLlib's weights begin, and what stable-baselines3 calls the same ones."""


@dataclass(frozen=True)
class Args(train_ppo.Args):
    """The command line of train_ppo, and who plays."""

    address: str | None = None
    """Of a Ray cluster: "auto" on one of its nodes, or HOST:PORT; by default Ray starts on this machine alone."""
    num_env_runners: int = 2
    """Processes that play, a core each; Ray spreads them over the nodes and replaces those that die."""
    num_envs: int = 256
    """Environments of each of them, played as one batch."""
    num_learners: int = 0
    """Processes that learn, a core each, from equal shares of the putts; 0: this program learns by itself."""
    target_kl: float = 0.02
    """How far an update should move the policy: RLlib's penalty on it grows and shrinks accordingly."""
    learning_rate: float = 1e-3
    """At the start; falls linearly to 0 as putts run out."""


class Run:
    """A learner and the folder of its checkpoints.

    Folders and files are written beside their place and then moved there: an interruption leaves the last whole one.
    """

    def __init__(self, args: Args, folder: Path) -> None:
        self.args, self.folder = args, folder
        self.algorithm = make_algorithm(args)
        # The same network for stable-baselines3: it lends its first weights, and carries those learned into a file.
        self.player = PPO(
            "MlpPolicy",
            gym.make(ENVIRONMENT, course=args.course),
            seed=args.seed,
            device="cpu",
            policy_kwargs={
                "net_arch": list(args.hidden),
                "activation_fn": torch.nn.Tanh,
                "log_std_init": args.log_std_init,
            },
        )
        self.putts, self.best = 0, float("inf")
        if self.checkpoints():
            self.algorithm.restore_from_path(str(self.checkpoints()[-1].resolve()))
            progress = json.loads((folder / "progress.json").read_text())
            self.putts, self.best = putts_of(self.checkpoints()[-1]), progress["best_strokes"]
        else:
            self.lend()
        self.saved_at = self.putts
        self.log = SummaryWriter(folder / "log", purge_step=self.putts)

    def checkpoints(self) -> list[Path]:
        """Return RLlib's checkpoints in the folder, the newest last."""
        return sorted(self.folder.glob("checkpoint-*"), key=putts_of)

    def lend(self) -> None:
        """Begin with the weights that stable-baselines3 would begin with."""
        theirs = self.player.policy.state_dict()
        weights = self.algorithm.learner_group.get_weights()
        mine = {name: theirs[renamed(name)].numpy() for name in weights[MODULE] if renamed(name) in theirs}
        self.algorithm.learner_group.set_weights({MODULE: {**weights[MODULE], **mine}})
        self.algorithm.env_runner_group.sync_weights(from_worker_or_learner_group=self.algorithm.learner_group)

    def learn(self, seconds: float) -> None:
        """Play and learn until the putts or the seconds run out."""
        until = time.monotonic() + seconds
        with tqdm(total=self.args.putts, initial=self.putts, unit=" putts") as bar:
            while self.putts < self.args.putts and time.monotonic() < until:
                played = self.algorithm.train()["env_runners"]
                before, self.putts = self.putts, int(played["num_env_steps_sampled_lifetime"])
                bar.update(self.putts - before)
                for name in ("episode_len_mean", "episode_return_mean"):
                    if name in played:  # Not before an episode has ended.
                        self.log.add_scalar(f"rollout/{name}", played[name], self.putts)
                if self.putts - self.saved_at >= self.args.check_every:
                    self.check()

    def check(self) -> None:
        """Save, evaluate, and keep the model if it is the best so far."""
        self.save()
        options = evaluate.Args(
            course=self.args.course, episodes=self.args.check_episodes, first_seed=self.args.check_seed
        )
        candidate = self.export(".candidate.zip")
        score = evaluate.evaluate(ModelPolicy(candidate), "PPO", options, quiet=True)
        for name in ("strokes", "holed", "hole_in_one"):
            self.log.add_scalar(f"eval/{name}", getattr(score, name), self.putts)
        if score.strokes < self.best:
            self.best = score.strokes
            candidate.replace(self.folder / "best.zip")
        candidate.unlink(missing_ok=True)
        self.write_progress()
        tqdm.write(
            f"{self.putts:>10,} putts: {score.strokes:.2f} strokes, {score.holed:.0%} holed, "
            f"{score.hole_in_one:.0%} holes-in-one (best {self.best:.2f})"
        )

    def save(self) -> None:
        """Write RLlib's checkpoint, from which a run goes on, and drop the one before."""
        beside, place = self.folder / ".checkpoint", self.folder / f"checkpoint-{self.putts}"
        shutil.rmtree(beside, ignore_errors=True)
        self.algorithm.save_to_path(str(beside.resolve()))
        shutil.rmtree(place, ignore_errors=True)
        beside.replace(place)
        self.write_progress()
        for old in self.checkpoints()[:-1]:
            shutil.rmtree(old)
        self.saved_at = self.putts

    def export(self, name: str) -> Path:
        """Write the model as stable-baselines3 would, under a name in the folder, and return its path."""
        weights = self.algorithm.learner_group.get_weights()[MODULE]
        theirs = {renamed(name): torch.as_tensor(weights[name]) for name in weights}
        policy = self.player.policy
        policy.load_state_dict({name: theirs[name] for name in policy.state_dict()})
        self.player.num_timesteps = self.putts
        self.player.save(self.folder / name)
        return self.folder / name

    def write_progress(self) -> None:
        """Write what a resumed run has to know beside the checkpoint."""
        progress = {"putts": self.putts, "best_strokes": self.best}
        train_ppo.write(self.folder / "progress.json", json.dumps(progress))


def renamed(name: str) -> str:
    """Return what stable-baselines3 calls one of RLlib's weights; the name itself if it has no such weight."""
    return next((theirs + name[len(ours) :] for ours, theirs in NAMES.items() if name.startswith(ours)), name)


def putts_of(checkpoint: Path) -> int:
    """Return the putts that were played before a checkpoint."""
    return int(checkpoint.name.rpartition("-")[2])


def make_algorithm(args: Args) -> Any:
    """Return a new RLlib learner, its environments spread over the cluster."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    putts = args.num_env_runners * args.num_envs * args.n_steps
    config = (
        PPOConfig()
        # The course itself, not its name: a course file need not be on the other nodes.
        .environment(ENVIRONMENT, env_config={"course": load_course(args.course)})
        .env_runners(
            num_env_runners=args.num_env_runners,
            num_envs_per_env_runner=args.num_envs,
            rollout_fragment_length=args.n_steps,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .training(
            lr=[[0, args.learning_rate], [args.putts, 0.0]],
            train_batch_size_per_learner=putts // max(1, args.num_learners),
            minibatch_size=args.batch_size,
            num_epochs=args.n_epochs,
            gamma=args.gamma,
            lambda_=args.gae_lambda,
            clip_param=args.clip_range,
            kl_target=args.target_kl,
            vf_loss_coeff=0.5,
            grad_clip=0.5,
        )
        .rl_module(
            model_config=DefaultModelConfig(
                fcnet_hiddens=list(args.hidden), fcnet_activation="tanh", vf_share_layers=False, free_log_std=True
            )
        )
        .learners(num_learners=args.num_learners)
        .fault_tolerance(restart_failed_env_runners=True)
        .debugging(seed=args.seed)
    )
    algorithm = config.build_algo()
    Path(algorithm.logdir).rmdir()  # RLlib makes a folder in the user's home; nothing is ever written to it.
    return algorithm


def train(args: Args, folder: Path) -> None:
    """Learn until the putts are played, from the folder's checkpoint if it has one; Ctrl-C saves and leaves."""
    torch.set_num_threads(1)  # The networks are tiny: a second thread mostly waits for the first, at full load.
    ray = connect(args.address)
    cores, wanted = int(ray.cluster_resources()["CPU"]), args.num_env_runners + args.num_learners
    if wanted > cores:  # RLlib would wait for them for ever.
        ray.shutdown()
        raise SystemExit(f"num_env_runners and num_learners: expected at most {cores} in all, the cores that Ray has.")
    run = Run(args, folder)
    try:
        run.learn(60.0 * args.minutes)
        run.check()
    except KeyboardInterrupt:
        run.save()
        raise SystemExit(f"Interrupted and saved. Go on with: python -m agents.train_rllib --resume {folder}") from None
    finally:
        run.log.close()
        run.algorithm.stop()
        ray.shutdown()


def read_args(folder: Path, address: str | None) -> Args:
    """Return the arguments a run was started with; the cluster may be at another address by now.

    Raises:
        SystemExit: there is no run to go on with.
    """
    if not (folder / "args.json").is_file():
        raise SystemExit(f"resume: expected the folder of a run, {folder} has no args.json.")
    stored: dict[str, Any] = json.loads((folder / "args.json").read_text())
    return Args(**{**stored, "hidden": tuple(stored["hidden"]), "address": address})


def main(args: Args) -> list[evaluate.Score]:
    """Train, evaluate, print the table."""
    began = time.monotonic()
    if args.num_env_runners < 1 or args.num_learners < 0:
        raise SystemExit("num_env_runners: expected at least 1; num_learners: at least 0.")
    if args.resume is not None:
        folder = args.resume
        args = read_args(folder, args.address)
    else:
        folder = train_ppo.new_folder(args)
        stored = {**dataclasses.asdict(args), "out": None, "resume": None}
        train_ppo.write(folder / "args.json", json.dumps(stored, indent=2) + "\n")
    train(args, folder)
    scores = train_ppo.final_table(args, folder)
    evaluate.print_scores(scores)
    CONSOLE.print(
        f"{time.monotonic() - began:.0f} s in all. Model: {folder / 'best.zip'}; log: tensorboard --logdir {folder}"
    )
    return scores


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
