"""Train Ray RLlib's PPO on a hole, on the cores of one machine or of many, and end with a table: random, search, PPO.

``python -m agents.train_rllib`` starts Ray on this machine, ``--address auto`` joins the cluster that this machine is a
node of; ``--resume runs/dogleg-1`` goes on after an interruption. docs/scaling.md has the commands for a cluster. The
folder is that of every run (runs.py), its models such as stable-baselines3 writes: ``minigolf`` reads them without Ray.
Beside them is checkpoint-PUTTS, RLlib's own, from which a run goes on.
"""

from __future__ import annotations

import dataclasses
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
import tyro
from rich.progress import MofNCompleteColumn, Progress
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure

from agents import runs
from agents.cluster import connect, import_ray
from agents.train_ppo import Settings
from minigolf_env._atomic_io import commit
from minigolf_env.courses import load_course
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.players.policies import load_policy

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
class Args(Settings):
    """The command line."""

    n_steps: int = 4
    batch_size: int = 512
    address: str | None = None
    """Of a Ray cluster: "auto" on one of its nodes, or HOST:PORT; by default Ray starts on this machine alone. With
    --resume it counts too: the cluster may have moved."""
    num_env_runners: int = 2
    """Processes that play, a core each; Ray spreads them over the nodes and replaces those that die."""
    num_envs: int = 256
    """Environments of each of them, played as one batch."""
    num_learners: int = 0
    """Processes that learn, a core each, from equal shares of the putts; 0: this program learns by itself."""

    @property
    def environment(self) -> dict[str, Any]:
        """The arguments of the environments, with the course itself: its file need not be on the other nodes."""
        course = self.course if self.course == PROCEDURAL_COURSE else load_course(self.course)
        return {
            **self.game,
            "course": course,
            "observation": self.observation,
            "reward": self.reward,
            "num_levels": self.num_levels,
        }


class Training(runs.Checkpoints):
    """RLlib's learner and its checkpoints; ``model`` is the same network as stable-baselines3 has it.

    Args:
        args: of the run.
        folder: of the run; if it has a checkpoint of RLlib's, the learner goes on from there.
    """

    def __init__(self, args: Args, folder: Path) -> None:
        super().__init__(args, folder)
        self.algorithm = make_algorithm(args)
        player = PPO(
            "MlpPolicy",
            gym.make(ENVIRONMENT, **args.environment),
            seed=args.seed,
            device="cpu",
            policy_kwargs={"net_arch": list(args.hidden), "log_std_init": args.log_std[0]},
        )
        player.set_logger(configure(str(folder / "log"), ["tensorboard"]))
        self.init_callback(player)
        if self.kept():
            self.algorithm.restore_from_path(str(self.kept()[-1].resolve()))
            self.num_timesteps = self.saved_at = putts_of(self.kept()[-1])
        else:
            self.lend()

    def kept(self) -> list[Path]:
        """Return RLlib's checkpoints in the folder, the newest last."""
        return sorted(self.folder.glob("checkpoint-*"), key=putts_of)

    def lend(self) -> None:
        """Begin with the weights that stable-baselines3 would begin with."""
        theirs = self.model.policy.state_dict()
        weights = self.algorithm.learner_group.get_weights()
        mine = {name: theirs[renamed(name)].numpy() for name in weights[MODULE] if renamed(name) in theirs}
        self.algorithm.learner_group.set_weights({MODULE: {**weights[MODULE], **mine}})
        self.algorithm.env_runner_group.sync_weights(from_worker_or_learner_group=self.algorithm.learner_group)

    def carry(self) -> None:
        """Bring what is learned so far into stable-baselines3's network."""
        weights = self.algorithm.learner_group.get_weights()[MODULE]
        theirs = {renamed(name): torch.as_tensor(weights[name]) for name in weights}
        policy = self.model.policy
        policy.load_state_dict({name: theirs[name] for name in policy.state_dict()})
        self.model.num_timesteps = self.num_timesteps

    def learn(self) -> None:
        """Play and learn until the putts are played."""
        with Progress(*Progress.get_default_columns(), MofNCompleteColumn(), console=runs.CONSOLE) as bar:
            task = bar.add_task("putts", total=self.args.putts, completed=self.num_timesteps)
            while self.num_timesteps < self.args.putts:
                played = self.algorithm.train()["env_runners"]
                self.num_timesteps = int(played["num_env_steps_sampled_lifetime"])
                bar.update(task, completed=self.num_timesteps)
                for name in ("episode_len_mean", "episode_return_mean"):
                    if name in played:  # Not before an episode has ended.
                        self.logger.record(f"rollout/{name}", played[name])
                self.logger.dump(self.num_timesteps)
                if self.num_timesteps - self.saved_at >= self.args.check_every:
                    self.check()

    def check(self) -> None:
        """Save, score, and keep the model if it is the best so far."""
        self.keep()
        self.carry()
        super().check()

    def keep(self) -> None:
        """Write RLlib's checkpoint, unless there is one after as many putts, and drop the one before."""
        beside, place = self.folder / ".checkpoint", self.folder / f"checkpoint-{self.num_timesteps}"
        shutil.rmtree(beside, ignore_errors=True)
        if not place.exists():
            self.algorithm.save_to_path(str(beside.resolve()))
            commit(beside, place)
        for old in self.kept()[:-1]:
            shutil.rmtree(old)


def renamed(name: str) -> str:
    """Return what stable-baselines3 calls one of RLlib's weights; the name itself if it has no such weight."""
    return next((theirs + name[len(ours) :] for ours, theirs in NAMES.items() if name.startswith(ours)), name)


def putts_of(checkpoint: Path) -> int:
    """Return the putts that were played before a checkpoint of RLlib's."""
    return int(checkpoint.name.rpartition("-")[2])


def make_algorithm(args: Args) -> Any:
    """Return a new RLlib learner, its environments spread over the cluster."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    putts = args.num_env_runners * args.num_envs * args.n_steps
    config = (
        PPOConfig()
        .environment(ENVIRONMENT, env_config=args.environment)
        .env_runners(
            num_env_runners=args.num_env_runners,
            num_envs_per_env_runner=args.num_envs,
            rollout_fragment_length=args.n_steps,
            gym_env_vectorize_mode="vector_entry_point",
        )
        .training(
            learner_class=annealing(args),
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


def annealing(args: Args) -> type[Any]:
    """Return RLlib's class of learners, with the noise on a fixed way from wide to narrow: see train_ppo.Annealing.

    It is set at the end of an update, before the workers are sent the weights: the putts an update learns from were all
    played with one noise, the one that it computes with.
    """
    from ray.rllib.algorithms.ppo.torch.ppo_torch_learner import PPOTorchLearner
    from ray.rllib.utils.metrics import NUM_ENV_STEPS_SAMPLED_LIFETIME

    class Annealing(PPOTorchLearner):  # type: ignore[misc] # Ray is not there to be checked.
        def get_parameters(self, module: Any) -> list[Any]:
            module.unwrapped().pi.log_std.requires_grad_(False)
            return [weights for weights in super().get_parameters(module) if weights.requires_grad]

        def after_gradient_based_update(self, *, timesteps: Mapping[str, int]) -> None:
            super().after_gradient_based_update(timesteps=timesteps)
            log_std = np.interp(timesteps[NUM_ENV_STEPS_SAMPLED_LIFETIME], (0, args.putts), args.log_std)
            self.module[MODULE].unwrapped().pi.log_std.data.fill_(float(log_std))

    return Annealing


def train(args: Args, folder: Path) -> None:
    """Learn until the putts are played, from the folder's checkpoint if it has one; Ctrl-C saves and leaves."""
    torch.set_num_threads(1)  # The networks are tiny: a second thread mostly waits for the first, at full load.
    ray = connect(args.address)
    try:
        cores, wanted = int(ray.cluster_resources()["CPU"]), args.num_env_runners + args.num_learners
        if wanted > cores:  # RLlib would wait for them for ever.
            raise SystemExit(f"num_env_runners and num_learners: expected at most {cores} in all, the cores Ray has.")
        training = Training(args, folder)
        try:
            with runs.stoppable(folder, training.keep):
                training.learn()
                training.check()
        finally:
            training.logger.close()
            training.algorithm.stop()
    finally:
        ray.shutdown()


def main(args: Args) -> list[EvaluationResult]:
    """Train, score, print the table."""
    began, address = time.monotonic(), args.address
    import_ray(address)  # Where it is missing, nothing is begun.
    if args.num_env_runners < 1 or args.num_learners < 0:
        raise SystemExit("num_env_runners: expected at least 1; num_learners: at least 0.")
    if args.observation == "pixels" or args.start is not None:
        raise SystemExit('observation: expected "state" or "rays", no --start: those are for one machine.')
    args, folder = runs.begin(args)
    args = dataclasses.replace(args, address=address)
    train(args, folder)
    return runs.end(args, PPO.__name__, load_policy(folder / "best.zip"), folder / "best.zip", began)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
