"""Any sequence of calls, valid and invalid ones, agrees with a small model; a rejected call changes nothing.

Set SEQUENCES=100000 to try so many instead of 1,000 (make fuzz).
"""

from __future__ import annotations

import copy
import os
import pickle
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from tests.envs.model import Model, Rules

NUM_SEQUENCES = int(os.environ.get("SEQUENCES", "1000"))
"""Number of sequences: half for a single environment, half for a batch."""

MAX_STEPS = 16
"""Number of calls in a sequence."""

NUM_ENVS = 3
"""Number of environments in a batch."""

PUTT_NOISE = (0.5, 0.015)
RULE_SETS = [
    Rules(),
    Rules(max_strokes=2, putt_noise=PUTT_NOISE, observation="rays", reward="strokes"),
    Rules("straight", max_strokes=3, tee="fixed", reward="strokes"),
    Rules("islands", max_strokes=4),
    Rules("round", max_strokes=1, putt_noise=PUTT_NOISE),
    Rules("procedural", max_strokes=2, reward="strokes"),
    Rules("procedural", start_level=7, num_levels=2, max_strokes=3, observation="rays", putt_noise=PUTT_NOISE),
]
RULE_SET_IDS = [f"{rules.course} {rules.max_strokes}" for rules in RULE_SETS]
AUTORESET_MODES = ["NextStep", "SameStep", "Disabled"]
PUTTS: list[Any] = [
    [0, 0],
    (0.3, -0.2),
    np.array([0.8, 0.38], np.float32),
    np.array([-1.0, 1.0]),
    [30.0, 4.0],
    np.array([1, 0], np.int8),
    [True, False],
    [1e-320, -0.0],
    [1e50, 0.0],
    0.25,
    0.35,
    0.5,
]
"""Valid putts; a number is a straight putt at the cup with that share of the top speed."""

INVALID_PUTTS: list[Any] = [
    [np.nan, 0.0],
    [0.1, -np.inf],
    [1e51, 0.0],
    [10**400, 0],
    [0.1],
    [0.1, 0.2, 0.3],
    [[[[0.1, 0.2]]]],
    0.1,
    None,
    "up",
    ["0.1", "0.2"],
    [None, 0.0],
    [1j, 0.0],
    np.array([0.1j, 0.2]),
    np.array(["2020", "2021"], "M8[Y]"),
    np.zeros(2, [("x", "f8")]),
    {"x": 0.1},
    [[], []],
]
INVALID_OPTIONS: list[Any] = [
    5,
    "tee",
    [("position", (0.4, 0.5, 0.1))],
    {"tee": "fixed"},
    {5: 1, "a": 2},
    {"position": (1.0, 2.0), "level": 0, "hole": 1},
    {"level": "first"},
    {"hole": 0},
    {"level": -1},
    {"level": 2**31},
    {"level": 1.0},
    {"level": [[0], [1, 2]]},
    {"position": (0.1, 0.2, 10**400)},
    {"position": (0.0, 0.0, -9.0)},
    {"reset_mask": [True]},
    {"reset_mask": np.ones(NUM_ENVS)},
    {"reset_mask": np.zeros(NUM_ENVS, np.bool_)},
]
INVALID_SEEDS: list[Any] = [-1, 1.5, "seed", [1.5] * NUM_ENVS, [0] * (NUM_ENVS + 1), {"a": 1}]
"""Seeds that single environments and batches reject; numpy's integers only single ones reject, as Gymnasium does."""

INVALID_STATES: list[Any] = [
    "left",
    {"position": (0.1, 0.2)},
    {"position": (0.1, 0.2, np.nan)},
    {"position": (0.1, 0.2, "3")},
    {"position": (0.0, 0.0, 10**400)},
    {"position": (900.0, 0.0, 0.0), "over": False},
    {"position": None},
    {"strokes": -1},
    {"strokes": 99},
    {"strokes": 1.0},
    {"over": 0},
    {"over": np.array(True)},
    {"stroke": 1},
    {5: 1},
    {"np_random": None},
    {"np_random": {"bit_generator": "PCG64", "state": {"state": 1.5, "inc": 1}, "has_uint32": 0, "uinteger": 0}},
    {"np_random": {"bit_generator": "PCG64", "state": {"state": 1, "inc": 1}, "has_uint32": 0, "uinteger": -1}},
]
"""Invalid values of a state, which replace valid ones."""

FOREIGN_GENERATOR_STATE = np.random.PCG64(99).state
"""State of a generator that no environment has: a rejected call must not leave it behind."""

INVALID_VALUES = [
    *(("options", value) for value in INVALID_OPTIONS),
    *(("seed", value) for value in INVALID_SEEDS),
    *(("putt", value) for value in INVALID_PUTTS),
    *(("state", value) for value in INVALID_STATES),
]

putts = st.sampled_from(PUTTS) | st.tuples(st.floats(-1, 1), st.floats(-1, 1))
seeds, holes, index = st.integers(0, 5), st.none() | st.integers(1, 9), st.integers(0, 99)


class EnvMachine(RuleBasedStateMachine):
    """Rules that one environment and a batch share. Each call is made in the model first, then in the environment.

    Args:
        env: the environment before its first reset.
        rules: its arguments.
        n: number of environments.
        renders: it renders, 32 by 24 pixels.
    """

    def __init__(self, env: Any, rules: Rules, n: int, renders: bool) -> None:
        super().__init__()
        self.env, self.env_rules, self.renders = env, rules, renders
        self.models = [Model(rules) for _ in range(n)]
        self.saved_states: list[dict[str, Any]] = []
        self.save_state(0)

    @property
    def is_reset(self) -> bool:
        """True after the first reset."""
        return self.models[0].rng is not None

    @abstractmethod
    def states(self) -> list[dict[str, Any]]:
        """Return the states of all environments."""

    @abstractmethod
    def place_invalid(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return an invalid value as the environment takes it: in a batch also among valid ones."""

    @abstractmethod
    def is_rendered(self, pictures: Any) -> bool:
        """Return true if this is the result of render with a render mode."""

    def assert_rejected(self, call: Callable[..., Any], *arguments: Any, **named: Any) -> None:
        """Check that a call raises an error of one line; the invariant checks that nothing has changed."""
        with pytest.raises((ValueError, gym.error.Error)) as caught:
            call(*arguments, **named)
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20

    @invariant()
    def states_equal_the_models(self) -> None:
        """The states of the environment equal the model's bit for bit, with the random number generators."""
        if self.is_reset:
            assert self.states() == [model.state for model in self.models]
        else:
            with pytest.raises(ResetNeeded):
                self.states()

    @rule(which=index)
    def save_state(self, which: int) -> None:
        """Save a state of one environment, and a state with a position only."""
        model = self.models[which % len(self.models)]
        if self.is_reset:
            self.saved_states.append(model.state)
        number = {} if self.env_rules.index_name is None else {self.env_rules.index_name: self.env_rules.default_index}
        above = replace(model, hole=self.env_rules.default_index).above_the_tee
        self.saved_states.append({"position": above, **number})

    @rule(sequence=st.lists(st.sampled_from(INVALID_VALUES), min_size=1, max_size=3), which=index)
    def make_invalid_calls(self, sequence: list[tuple[str, Any]], which: int) -> None:
        """Make calls with an invalid argument."""
        for what, value in sequence:
            if what == "options":
                self.assert_rejected(self.env.reset, seed=1, options=value)
            elif what == "seed":
                self.assert_rejected(self.env.reset, seed=value)
            elif what == "putt":
                for actions in self.place_invalid(value, [0.1, 0.2], which):
                    self.assert_rejected(self.env.step, actions)
                    self.assert_rejected(self.env.what_if, None if actions is None else [actions])
            else:
                good = {
                    **self.saved_states[which % len(self.saved_states)],
                    "over": False,
                    "np_random": FOREIGN_GENERATOR_STATE,
                }
                for states in self.place_invalid({**good, **value} if isinstance(value, dict) else value, good, which):
                    self.assert_rejected(self.env.set_state, states)

    @rule()
    def close(self) -> None:
        """Close the environment, which may continue afterwards."""
        self.env.close()

    @rule(how=st.sampled_from(["pickle", "deepcopy"]))
    def continue_with_a_copy(self, how: str) -> None:
        """Continue with a copy, which has the same bits."""
        env = self.env
        self.env = copy.deepcopy(env) if how == "deepcopy" else pickle.loads(pickle.dumps(env))  # noqa: S301 (ours)

    @rule(sequence=st.lists(putts, max_size=3))
    def what_if(self, sequence: list[Any]) -> None:
        """Simulate putts without moving a ball."""
        sequence = [self.models[0].to_action(putt) for putt in sequence]
        actions = np.array(sequence, float).reshape(-1, 2)
        if not self.is_reset:
            return self.assert_rejected(self.env.what_if, actions)
        outcome = self.env.what_if(actions).reshape(len(self.models), len(sequence))
        for i, model in enumerate(self.models):
            for k, putt in enumerate(sequence):
                other = replace(model, rules=replace(self.env_rules, putt_noise=(0.0, 0.0)), over=False)
                other.step(putt)
                assert tuple(outcome.position[i, k]) == other.position
                assert outcome.holed[i, k] == other.info["is_success"]

    @rule()
    def render(self) -> None:
        """Render."""
        if not self.is_reset:
            return self.assert_rejected(self.env.render)
        pictures = self.env.render()
        assert self.is_rendered(pictures) if self.renders else pictures is None


class SingleMachine(EnvMachine):
    """Calls of a single environment."""

    def __init__(self, rules: Rules, pictures: dict[str, Any]) -> None:
        super().__init__(MiniGolfEnv(**rules.options, **pictures), rules, 1, bool(pictures))
        self.model = self.models[0]

    def states(self) -> list[dict[str, Any]]:
        """Return its state."""
        return [self.env.get_state()]

    def place_invalid(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return the value alone."""
        return [bad]

    def is_rendered(self, pictures: Any) -> bool:
        """Return true for an image."""
        return bool(pictures.shape == (24, 32, 3) and pictures.dtype == np.uint8)

    def check_result(self, observation: Any, info: dict[str, Any]) -> None:
        """Check the observation and info of reset or step."""
        assert self.env.observation_space.contains(observation) and self.model.is_observed(observation)
        assert info == self.model.info
        assert [type(value) for value in info.values()] == [type(value) for value in self.model.info.values()]

    @initialize(resets=st.booleans())
    def start(self, resets: bool) -> None:
        """Start with a reset, or without."""
        if resets:
            self.reset(0, None, False)

    @rule(seed=seeds | st.none(), hole=holes, put=st.booleans())
    def reset(self, seed: int | None, hole: int | None, put: bool) -> None:
        """Reset with or without a seed, a hole and a position."""
        seed = seed if self.is_reset else seed or 0
        hole = None if self.env_rules.index_name is None else hole
        put = put and (self.env_rules.index_name is None or hole is not None)
        position = replace(self.model, hole=hole).above_the_tee if put else None
        self.model.reset(seed, hole, position)
        given = {"position": position, self.env_rules.index_name or "level": hole}
        self.check_result(
            *self.env.reset(seed=seed, options={key: value for key, value in given.items() if value is not None})
        )

    @rule(sequence=st.lists(putts, min_size=1, max_size=4))
    def step(self, sequence: list[Any]) -> None:
        """Play putts; steps after the end are rejected."""
        for putt in sequence:
            self.play(self.model.to_action(putt))

    def play(self, putt: Any) -> None:
        """Play one putt."""
        if not self.is_reset or self.model.over:
            return self.assert_rejected(self.env.step, putt)
        self.model.step(putt)
        observation, reward, terminated, truncated, info = self.env.step(putt)
        self.check_result(observation, info)
        assert (terminated, truncated) == (self.model.over, False)
        assert type(reward) is float and (reward == -1.0 if self.env_rules.reward == "strokes" else np.isfinite(reward))

    @rule(which=index)
    def set_state(self, which: int) -> None:
        """Resume a saved state."""
        state = self.saved_states[which % len(self.saved_states)]
        before = copy.deepcopy(state)
        self.env.set_state(state)
        assert state == before
        self.model.resume(state if "np_random" in state or self.is_reset else self.env.get_state())


class BatchMachine(EnvMachine):
    """Calls of a batch."""

    def __init__(self, rules: Rules, mode: str, pictures: dict[str, Any]) -> None:
        batch = MiniGolfVectorEnv(NUM_ENVS, autoreset_mode=mode, **rules.options, **pictures)
        super().__init__(batch, rules, NUM_ENVS, bool(pictures))
        self.mode = mode

    def states(self) -> list[dict[str, Any]]:
        """Return the states."""
        states: list[dict[str, Any]] = self.env.get_state()
        return states

    def place_invalid(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return a list with the value in one place, and the value instead of a list."""
        return [[bad if which % NUM_ENVS == i else good for i in range(NUM_ENVS)], bad]

    def is_rendered(self, pictures: Any) -> bool:
        """Return true for a list of images."""
        return [picture.shape for picture in pictures] == [(24, 32, 3)] * NUM_ENVS

    def check_result(self, i: int, model: Model, observations: Any, infos: dict[str, Any]) -> None:
        """Check the observation and info of environment i."""
        assert self.env.single_observation_space.contains(observations[i]) and model.is_observed(observations[i])
        assert {key: infos[key][i] for key in model.info} == model.info
        assert all(infos[f"_{key}"][i] for key in model.info)

    @initialize(resets=st.booleans())
    def start(self, resets: bool) -> None:
        """Start with a reset, or without."""
        if resets:
            self.reset(0, None, 0)

    @rule(seed=seeds | st.lists(seeds | st.none(), min_size=NUM_ENVS, max_size=NUM_ENVS), hole=holes, mask=index)
    def reset(self, seed: Any, hole: int | None, mask: int) -> None:
        """Reset all or some environments, with one seed, several or none, on selected holes."""
        seed = seed if self.is_reset or isinstance(seed, int) else [one or 0 for one in seed]
        chosen = np.array([mask >> i & 1 for i in range(NUM_ENVS)], np.bool_)
        options: dict[str, Any] = {"reset_mask": chosen} if chosen.any() else {}
        if hole is not None and self.env_rules.index_name is not None:
            options[self.env_rules.index_name] = [hole] * NUM_ENVS if mask & 8 else hole
        if not self.is_reset and 0 < chosen.sum() < NUM_ENVS:
            return self.assert_rejected(self.env.reset, seed=seed, options=options)
        for i in np.flatnonzero(chosen) if chosen.any() else range(NUM_ENVS):
            own = seed + int(i) if isinstance(seed, int) else seed[i]
            self.models[i].reset(own, hole if self.env_rules.index_name else None)
        observations, infos = self.env.reset(seed=seed, options=options)
        assert infos.keys() == {name for key in self.models[0].info for name in (key, f"_{key}")}
        for i, model in enumerate(self.models):
            if chosen[i] or not chosen.any():
                self.check_result(i, model, observations, infos)
            else:
                assert not any(infos[f"_{key}"][i] for key in model.info)

    @rule(sequence=st.lists(st.lists(putts, min_size=NUM_ENVS, max_size=NUM_ENVS), min_size=1, max_size=4))
    def step(self, sequence: list[list[Any]]) -> None:
        """Play putts in every environment, according to the autoreset mode."""
        for each in sequence:
            self.play([model.to_action(putt) for model, putt in zip(self.models, each, strict=True)])

    def play(self, each: list[Any]) -> None:
        """Play one putt in each environment."""
        if not self.is_reset or (self.mode == "Disabled" and any(model.over for model in self.models)):
            return self.assert_rejected(self.env.step, each)
        idle = np.array([model.over for model in self.models])
        for model, putt in zip(self.models, each, strict=True):
            model.reset(None) if model.over else model.step(putt)
        observations, rewards, terminated, truncated, infos = self.env.step(each)
        over = [model.over for model in self.models]
        assert (terminated.tolist(), truncated.any()) == (over, False)
        assert np.isfinite(rewards).all() and not rewards[idle].any()
        assert self.env_rules.reward == "shaped" or rewards.tolist() == (idle - 1.0).tolist()
        for i, model in enumerate(self.models):
            if self.mode == "SameStep" and model.over:
                self.check_result(i, model, infos["final_obs"], infos["final_info"])
                assert infos["_final_obs"][i] and infos["_final_info"][i]
                model.reset(None)
            self.check_result(i, model, observations, infos)
        assert ("final_obs" in infos) == (self.mode == "SameStep" and any(over))

    @rule(which=st.lists(index, min_size=NUM_ENVS, max_size=NUM_ENVS))
    def set_state(self, which: list[int]) -> None:
        """Resume saved states, of any environments."""
        states = [self.saved_states[k % len(self.saved_states)] for k in which]
        if self.mode == "SameStep" and any(state.get("over") for state in states):
            return self.assert_rejected(self.env.set_state, states)
        self.env.set_state(states)
        now = self.env.get_state()
        for i, model in enumerate(self.models):
            model.resume(states[i] if "np_random" in states[i] or model.rng is not None else now[i])


def run(machine: Callable[[], EnvMachine], sequences: int) -> None:
    """Try a number of sequences."""
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=sequences, stateful_step_count=MAX_STEPS, deadline=None, suppress_health_check=slow
        ),
    )


@pytest.mark.parametrize("rules", RULE_SETS, ids=RULE_SET_IDS)
def test_calls_of_an_environment_agree_with_the_model(rules: Rules) -> None:
    """Any sequence, for each set of rules."""
    run(partial(SingleMachine, rules, {}), -(-NUM_SEQUENCES // (2 * len(RULE_SETS))))


@pytest.mark.parametrize("mode", AUTORESET_MODES)
@pytest.mark.parametrize("rules", RULE_SETS, ids=RULE_SET_IDS)
def test_calls_of_a_batch_agree_with_the_model(rules: Rules, mode: str) -> None:
    """Any sequence, in every autoreset mode."""
    run(partial(BatchMachine, rules, mode, {}), -(-NUM_SEQUENCES // (2 * len(RULE_SETS) * len(AUTORESET_MODES))))


@pytest.mark.parametrize("rules", RULE_SETS[-2:], ids=RULE_SET_IDS[-2:])
def test_rendering_between_calls_changes_nothing(rules: Rules, gl: None) -> None:
    """Any sequence with rendering agrees with the model, for one environment and a batch."""
    show = {"render_mode": "rgb_array", "render_size": (32, 24), "render_profile": "fast"}
    run(partial(SingleMachine, rules, show), max(1, NUM_SEQUENCES // 100))
    run(partial(BatchMachine, rules, "SameStep", show), max(1, NUM_SEQUENCES // 100))
