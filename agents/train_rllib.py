"""Train Ray RLlib's PPO on a hole, on the cores of one or many machines, and end with a table: random, search, PPO.

Without options Ray starts on this machine; ``--address auto`` joins the cluster that this machine is a node of, and
with ``--resume runs/dogleg-1`` a run continues after an interruption. The commands for a cluster are in
docs/scaling.md.

The run folder is that of every sample (training_run.py). Its models are in the format of stable-baselines3, so that the
command ``minigolf`` reads them without Ray. RLlib's own checkpoint, from which a run resumes, is checkpoint-TIMESTEPS.
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
import torch
from rich.progress import MofNCompleteColumn, Progress
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure

from agents.cluster import connect, import_ray
from agents.command_line import run_program
from agents.run_evaluation import EvalCheckpointCallback, check_history, finish_run
from agents.train_ppo import PPOHyperparameters
from agents.training_run import (
    RICH_CONSOLE,
    read_config,
    save_on_interrupt,
    start_run,
    validate_config,
)
from minigolf_env._atomic_io import commit
from minigolf_env.courses import load_course
from minigolf_env.courses.procedural import PROCEDURAL_COURSE
from minigolf_env.evaluation.evaluate import EvaluationResult
from minigolf_env.players.policies import load_policy

ENV_ID = "minigolf_env:MiniGolf-v0"
"""Environment with its module's name, which a worker on another node must import to register it."""

SAMPLE_TIMEOUT = 600.0
"""Time in which the workers have to return samples, s; the first ones include compilation and building the levels."""

MODULE_ID = "default_policy"
"""RLlib's name of the only network."""

SB3_NAME_PREFIXES = {
    "encoder.actor_encoder.net.mlp.": "mlp_extractor.policy_net.",
    "encoder.critic_encoder.net.mlp.": "mlp_extractor.value_net.",
    "pi.net.mlp.0.": "action_net.",
    "vf.net.mlp.0.": "value_net.",
    "pi.log_std": "log_std",
}
"""Prefixes of RLlib's weight names, and those of the same weights in stable-baselines3."""


@dataclass(frozen=True)
class RLlibConfig(PPOHyperparameters):
    """Command-line arguments of this program."""

    n_steps: int = 4
    batch_size: int = 512
    address: str | None = None
    """Ray cluster: "auto" on one of its nodes, or HOST:PORT; by default Ray starts on this machine alone.
    With --resume the stored address counts unless another one is given, as the cluster may have moved."""
    num_env_runners: int = 2
    """Number of workers, which play the putts; each takes a core, and Ray replaces those that die, on any node."""
    n_envs: int = 256
    """Number of environments in the vector environment of each worker."""
    num_learners: int = 0
    """Number of learning processes, one core each, with an equal part of each batch; 0 learns in this program."""

    @property
    def env_config(self) -> dict[str, Any]:
        """Arguments of the environments, with the loaded course: its file need not be on the other nodes."""
        course = self.course if self.course == PROCEDURAL_COURSE else load_course(self.course)
        return {
            **self.env_args,
            "course": course,
            "observation": self.observation,
            "reward": self.reward,
            "num_levels": self.num_levels,
        }


class RLlibTrainer(EvalCheckpointCallback):
    """RLlib's algorithm with its checkpoints; ``model`` is the same network in stable-baselines3.

    Args:
        config: configuration of the run.
        folder: run folder; if it has a checkpoint of RLlib's, training resumes there.
    """

    def __init__(self, config: RLlibConfig, folder: Path) -> None:
        self.algorithm = make_algorithm(config)
        sb3_model = PPO(
            "MlpPolicy",
            gym.make(ENV_ID, **config.env_config),
            seed=config.seed,
            device="cpu",
            policy_kwargs={"net_arch": list(config.net_arch), "log_std_init": config.log_std_init},
        )
        sb3_model.set_logger(configure(str(folder / "log"), ["tensorboard"]))
        super().__init__(config, folder, sb3_model)
        if self.checkpoints():
            newest = self.checkpoints()[-1]
            self.algorithm.restore_from_path(str(newest.resolve()))
            self.num_timesteps = timesteps_of(newest)
            self.last_saved = self.num_timesteps
        else:
            self.init_from_sb3()

    def checkpoints(self) -> list[Path]:
        """Return RLlib's checkpoints in the run folder, the newest last."""
        return sorted(self.folder.glob("checkpoint-*"), key=timesteps_of)

    def init_from_sb3(self) -> None:
        """Copy the initial weights of stable-baselines3's network to RLlib's learner and workers."""
        sb3_weights = self.model.policy.state_dict()
        weights = self.algorithm.learner_group.get_weights()
        copied = {
            name: sb3_weights[to_sb3_name(name)].numpy()
            for name in weights[MODULE_ID]
            if to_sb3_name(name) in sb3_weights
        }
        self.algorithm.learner_group.set_weights({MODULE_ID: {**weights[MODULE_ID], **copied}})
        self.algorithm.env_runner_group.sync_weights(from_worker_or_learner_group=self.algorithm.learner_group)

    def sync_to_sb3(self) -> None:
        """Copy the learner's weights to stable-baselines3's network."""
        weights = self.algorithm.learner_group.get_weights()[MODULE_ID]
        sb3_weights = {to_sb3_name(name): torch.as_tensor(weights[name]) for name in weights}
        policy = self.model.policy
        policy.load_state_dict({name: sb3_weights[name] for name in policy.state_dict()})
        self.model.num_timesteps = self.num_timesteps

    def learn(self) -> None:
        """Sample and learn until ``total_timesteps`` putts are played."""
        total = self.config.total_timesteps
        with Progress(*Progress.get_default_columns(), MofNCompleteColumn(), console=RICH_CONSOLE) as bar:
            bar_task = bar.add_task("time steps", total=total, completed=self.num_timesteps)
            while self.num_timesteps < total:
                results = self.algorithm.train()["env_runners"]
                self.num_timesteps = int(results["num_env_steps_sampled_lifetime"])
                bar.update(bar_task, completed=self.num_timesteps)
                for name in ("episode_len_mean", "episode_return_mean"):
                    if name in results:  # Missing until an episode has ended.
                        self.logger.record(f"rollout/{name}", results[name])
                self.logger.dump(self.num_timesteps)
                if self.num_timesteps - self.last_saved >= self.config.eval_freq:
                    self.save_and_evaluate()

    def save_and_evaluate(self) -> None:
        """Save RLlib's checkpoint and the model, evaluate the model, and keep it if it is the best so far."""
        self.save_rllib_checkpoint()
        self.sync_to_sb3()
        super().save_and_evaluate()

    def save_rllib_checkpoint(self) -> None:
        """Write RLlib's checkpoint, unless this time step has one, then remove the older ones."""
        temporary_folder = self.folder / ".checkpoint"
        checkpoint = self.folder / f"checkpoint-{self.num_timesteps}"
        shutil.rmtree(temporary_folder, ignore_errors=True)
        if not checkpoint.exists():
            self.algorithm.save_to_path(str(temporary_folder.resolve()))
            commit(temporary_folder, checkpoint)
        for older in self.checkpoints()[:-1]:
            shutil.rmtree(older)


def to_sb3_name(name: str) -> str:
    """Return stable-baselines3's name of one of RLlib's weights, or the name itself if there is no such weight."""
    for prefix, sb3_prefix in SB3_NAME_PREFIXES.items():
        if name.startswith(prefix):
            return sb3_prefix + name.removeprefix(prefix)
    return name


def timesteps_of(checkpoint: Path) -> int:
    """Return the time step of one of RLlib's checkpoints, from its name."""
    return int(checkpoint.name.rpartition("-")[2])


def make_algorithm(config: RLlibConfig) -> Any:
    """Return RLlib's PPO, its environments spread over the cluster."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    rollout_size = config.num_env_runners * config.n_envs * config.n_steps
    rllib_config = (
        PPOConfig()
        .environment(ENV_ID, env_config=config.env_config)
        .env_runners(
            num_env_runners=config.num_env_runners,
            num_envs_per_env_runner=config.n_envs,
            rollout_fragment_length=config.n_steps,
            gym_env_vectorize_mode="vector_entry_point",
            sample_timeout_s=SAMPLE_TIMEOUT,
        )
        .training(
            learner_class=make_learner_class(config),
            lr=[[0, config.learning_rate], [config.total_timesteps, 0.0]],
            train_batch_size_per_learner=rollout_size // max(1, config.num_learners),
            minibatch_size=config.batch_size,
            num_epochs=config.n_epochs,
            gamma=config.gamma,
            lambda_=config.gae_lambda,
            clip_param=config.clip_range,
            kl_target=config.target_kl,
            vf_loss_coeff=0.5,
            grad_clip=0.5,
        )
        .rl_module(
            model_config=DefaultModelConfig(
                fcnet_hiddens=list(config.net_arch), fcnet_activation="tanh", vf_share_layers=False, free_log_std=True
            )
        )
        .learners(num_learners=config.num_learners)
        .fault_tolerance(restart_failed_env_runners=True)
        .debugging(seed=config.seed)
    )
    algorithm = rllib_config.build_algo()
    Path(algorithm.logdir).rmdir()  # RLlib makes a folder in the user's home, to which nothing is ever written.
    return algorithm


def make_learner_class(config: RLlibConfig) -> type[Any]:
    """Return a class of RLlib's PPO learner whose action noise follows the schedule of train_ppo.LogStdSchedule.

    The noise changes at the end of an update, before the workers receive the weights, so that all putts of an update
    were played with the noise that it computes with.
    """
    from ray.rllib.algorithms.ppo.torch.ppo_torch_learner import PPOTorchLearner
    from ray.rllib.utils.metrics import NUM_ENV_STEPS_SAMPLED_LIFETIME

    class LogStdScheduleLearner(PPOTorchLearner):  # type: ignore[misc] # Ray is not installed where types are checked.
        def get_parameters(self, module: Any) -> list[Any]:
            module.unwrapped().pi.log_std.requires_grad_(False)
            return [weights for weights in super().get_parameters(module) if weights.requires_grad]

        def after_gradient_based_update(self, *, timesteps: Mapping[str, int]) -> None:
            super().after_gradient_based_update(timesteps=timesteps)
            log_std = config.log_std_at(timesteps[NUM_ENV_STEPS_SAMPLED_LIFETIME])
            self.module[MODULE_ID].unwrapped().pi.log_std.data.fill_(log_std)

    return LogStdScheduleLearner


def train(config: RLlibConfig, folder: Path) -> None:
    """Train until all putts are played, from the checkpoint in the folder if there is one; Ctrl-C saves first."""
    torch.set_num_threads(1)  # The networks are tiny: a second thread only waits for the first, at full load.
    ray = connect(config.address)
    try:
        num_cores = int(ray.cluster_resources()["CPU"])
        if config.num_env_runners + config.num_learners > num_cores:  # RLlib would wait for the cores for ever.
            raise SystemExit(
                f"num_env_runners: expected at most {num_cores - config.num_learners}, the cores that Ray has without "
                f"those of num_learners, received {config.num_env_runners}."
            )
        trainer = RLlibTrainer(config, folder)
        try:
            with save_on_interrupt(folder, trainer.save_rllib_checkpoint):
                trainer.learn()
                trainer.save_and_evaluate()
        finally:
            trainer.logger.close()
            trainer.algorithm.stop()
    finally:
        ray.shutdown()


def address_of(config: RLlibConfig) -> str | None:
    """Return the address of the Ray cluster: the given one, or that of the run which is resumed."""
    if config.address is None and config.resume is not None:
        return read_config(RLlibConfig, config.resume).address
    return config.address


def check_checkpoints(config: RLlibConfig, folder: Path | None) -> None:
    """Check that the run folder that is resumed has checkpoints to its evaluations, or raise an error."""
    if folder is not None:
        check_history(config, folder, "checkpoint-*")
        for checkpoint in folder.glob("checkpoint-*"):
            timesteps_of(checkpoint)


def main(config: RLlibConfig) -> list[EvaluationResult]:
    """Train one model, evaluate its best checkpoint, and print a table of the results.

    Raises:
        SystemExit: an argument is invalid, Ray or its cluster is missing, or the run was interrupted; the message is
            one line.
    """
    started = time.monotonic()
    if config.observation == "pixels":
        raise SystemExit(
            'observation: expected "state", "rays" or "bounce_rays", received "pixels"; use agents.train_pixels.'
        )
    if config.init_weights is not None:
        raise SystemExit(f"init_weights: expected none, received {config.init_weights}; use agents.train_ppo.")
    validate_config(config if config.resume is None else read_config(RLlibConfig, config.resume))
    address = address_of(config)
    import_ray(address)  # Fails here where Ray is missing, before a folder is created.
    config, folder = start_run(config, check_checkpoints)
    config = dataclasses.replace(config, address=address)
    train(config, folder)
    best_model = folder / "best.zip"
    return finish_run(config, "PPO", load_policy(best_model), best_model, started)


if __name__ == "__main__":
    run_program(main, RLlibConfig, __doc__)
