"""Any sequence of calls, good ones and bad ones, does what a small model says; a refused one changes nothing.

SEQUENCES=100000 tries so many instead of 1,000 (make fuzz).
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

SEQUENCES = int(os.environ.get("SEQUENCES", "1000"))
"""Half of them of one environment, half of a batch."""

STEPS = 16
"""Calls in a sequence."""

N = 3
"""Environments in a batch."""

NOISE = (0.5, 0.015)
RULES = [
    Rules(),
    Rules(max_strokes=2, putt_noise=NOISE, observation="rays", reward="strokes"),
    Rules("straight", max_strokes=3, tee="fixed", reward="strokes"),
    Rules("islands", max_strokes=4),
    Rules("round", max_strokes=1, putt_noise=NOISE),
    Rules("procedural", max_strokes=2, reward="strokes"),
    Rules("procedural", start_level=7, num_levels=2, max_strokes=3, observation="rays", putt_noise=NOISE),
]
IDS = [f"{rules.course} {rules.max_strokes}" for rules in RULES]
MODES = ["NextStep", "SameStep", "Disabled"]
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
"""Numbers stand for straight putts at the cup with that share of the top speed."""

BAD_PUTTS: list[Any] = [
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
BAD_OPTIONS: list[Any] = [
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
    {"reset_mask": np.ones(N)},
    {"reset_mask": np.zeros(N, np.bool_)},
]
BAD_SEEDS: list[Any] = [-1, 1.5, "seed", [1.5] * N, [0] * (N + 1), {"a": 1}]
"""For both; Gymnasium refuses numpy's integers in single environments, and so do these."""

BAD_STATES: list[Any] = [
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
"""What is wrong of a state, in place of what was right."""

OTHER = np.random.PCG64(99).state
"""A generator that no environment has: what is refused must not leave it behind."""

BAD = [
    *(("options", value) for value in BAD_OPTIONS),
    *(("seed", value) for value in BAD_SEEDS),
    *(("putt", value) for value in BAD_PUTTS),
    *(("state", value) for value in BAD_STATES),
]

putts = st.sampled_from(PUTTS) | st.tuples(st.floats(-1, 1), st.floats(-1, 1))
seeds, holes, index = st.integers(0, 5), st.none() | st.integers(1, 9), st.integers(0, 99)


class Play(RuleBasedStateMachine):
    """What one environment and a batch share; the model is told of each call before the environment.

    Args:
        env: not reset yet.
        rules: its options.
        n: how many environments it is.
        pictures: whether it draws them, 32 by 24 pixels.
    """

    def __init__(self, env: Any, rules: Rules, n: int, pictures: bool) -> None:
        super().__init__()
        self.env, self.game, self.pictures = env, rules, pictures
        self.models = [Model(rules) for _ in range(n)]
        self.kept: list[dict[str, Any]] = []
        self.keep(0)

    @property
    def has_begun(self) -> bool:
        """Whether there are balls."""
        return self.models[0].rng is not None

    @abstractmethod
    def states(self) -> list[dict[str, Any]]:
        """Return the states of all environments."""

    @abstractmethod
    def among_good(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return something bad as the environment takes it: in a batch also among good ones."""

    @abstractmethod
    def looks_right(self, pictures: Any) -> bool:
        """Return whether that is what render gives if it draws."""

    def refused(self, call: Callable[..., Any], *arguments: Any, **named: Any) -> None:
        """Check that a call raises an error of one line; that nothing has changed is checked after each rule."""
        with pytest.raises((ValueError, gym.error.Error)) as caught:
            call(*arguments, **named)
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20

    @invariant()
    def states_are_the_models(self) -> None:
        """To the last bit, the random numbers included."""
        if self.has_begun:
            assert self.states() == [model.state for model in self.models]
        else:
            with pytest.raises(ResetNeeded):
                self.states()

    @rule(which=index)
    def keep(self, which: int) -> None:
        """Keep a state of one environment, and one of a position alone."""
        model = self.models[which % len(self.models)]
        if self.has_begun:
            self.kept.append(model.state)
        number = {} if self.game.key is None else {self.game.key: self.game.first}
        above = replace(model, hole=self.game.first).above_the_tee
        self.kept.append({"position": above, **number})

    @rule(several=st.lists(st.sampled_from(BAD), min_size=1, max_size=3), which=index)
    def refuse(self, several: list[tuple[str, Any]], which: int) -> None:
        """Whatever is wrong of a call."""
        for what, value in several:
            if what == "options":
                self.refused(self.env.reset, seed=1, options=value)
            elif what == "seed":
                self.refused(self.env.reset, seed=value)
            elif what == "putt":
                for actions in self.among_good(value, [0.1, 0.2], which):
                    self.refused(self.env.step, actions)
                    self.refused(self.env.what_if, None if actions is None else [actions])
            else:
                good = {**self.kept[which % len(self.kept)], "over": False, "np_random": OTHER}
                for states in self.among_good({**good, **value} if isinstance(value, dict) else value, good, which):
                    self.refused(self.env.set_state, states)

    @rule()
    def close(self) -> None:
        """As often as one likes; what goes on after it is the same."""
        self.env.close()

    @rule(how=st.sampled_from(["pickle", "deepcopy"]))
    def go_on_with_a_copy(self, how: str) -> None:
        """A copy plays on with the same bits."""
        env = self.env
        self.env = copy.deepcopy(env) if how == "deepcopy" else pickle.loads(pickle.dumps(env))  # noqa: S301 (ours)

    @rule(several=st.lists(putts, max_size=3))
    def what_if(self, several: list[Any]) -> None:
        """Foretell without moving a ball."""
        several = [self.models[0].aim(putt) for putt in several]
        actions = np.array(several, float).reshape(-1, 2)
        if not self.has_begun:
            return self.refused(self.env.what_if, actions)
        outcome = self.env.what_if(actions).reshape(len(self.models), len(several))
        for i, model in enumerate(self.models):
            for k, putt in enumerate(several):
                twin = replace(model, rules=replace(self.game, putt_noise=(0.0, 0.0)), over=False)
                twin.step(putt)
                assert (tuple(outcome.position[i, k]), outcome.holed[i, k]) == (twin.position, twin.info["is_success"])

    @rule()
    def render(self) -> None:
        """Return what the render mode promises."""
        if not self.has_begun:
            return self.refused(self.env.render)
        pictures = self.env.render()
        assert self.looks_right(pictures) if self.pictures else pictures is None


class Alone(Play):
    """One environment."""

    def __init__(self, rules: Rules, pictures: dict[str, Any]) -> None:
        super().__init__(MiniGolfEnv(**rules.options, **pictures), rules, 1, bool(pictures))
        self.model = self.models[0]

    def states(self) -> list[dict[str, Any]]:
        """Return its state."""
        return [self.env.get_state()]

    def among_good(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return it as it is."""
        return [bad]

    def looks_right(self, pictures: Any) -> bool:
        """Return whether it is a picture."""
        return bool(pictures.shape == (24, 32, 3) and pictures.dtype == np.uint8)

    def told(self, observation: Any, info: dict[str, Any]) -> None:
        """Check what reset and step return."""
        assert self.env.observation_space.contains(observation) and self.model.is_seen(observation)
        assert info == self.model.info
        assert [type(value) for value in info.values()] == [type(value) for value in self.model.info.values()]

    @initialize(begun=st.booleans())
    def begin(self, begun: bool) -> None:
        """Start with a reset, or not."""
        if begun:
            self.reset(0, None, False)

    @rule(seed=seeds | st.none(), hole=holes, put=st.booleans())
    def reset(self, seed: int | None, hole: int | None, put: bool) -> None:
        """With a seed or without, on a chosen hole, at a chosen place."""
        seed = seed if self.has_begun else seed or 0
        hole = None if self.game.key is None else hole
        put = put and (self.game.key is None or hole is not None)
        position = replace(self.model, hole=hole).above_the_tee if put else None
        self.model.reset(seed, hole, position)
        given = {"position": position, self.game.key or "level": hole}
        self.told(*self.env.reset(seed=seed, options={key: value for key, value in given.items() if value is not None}))

    @rule(several=st.lists(putts, min_size=1, max_size=4))
    def step(self, several: list[Any]) -> None:
        """Play, as long as there is a ball to be played."""
        for putt in several:
            self.play(self.model.aim(putt))

    def play(self, putt: Any) -> None:
        """Play one putt."""
        if not self.has_begun or self.model.over:
            return self.refused(self.env.step, putt)
        self.model.step(putt)
        observation, reward, terminated, truncated, info = self.env.step(putt)
        self.told(observation, info)
        assert (terminated, truncated) == (self.model.over, False)
        assert type(reward) is float and (reward == -1.0 if self.game.reward == "strokes" else np.isfinite(reward))

    @rule(which=index)
    def set_state(self, which: int) -> None:
        """Go on from a kept state."""
        state = self.kept[which % len(self.kept)]
        before = copy.deepcopy(state)
        self.env.set_state(state)
        assert state == before
        self.model.enter(state if "np_random" in state or self.has_begun else self.env.get_state())


class Together(Play):
    """A batch."""

    def __init__(self, rules: Rules, mode: str, pictures: dict[str, Any]) -> None:
        batch = MiniGolfVectorEnv(N, autoreset_mode=mode, **rules.options, **pictures)
        super().__init__(batch, rules, N, bool(pictures))
        self.mode = mode

    def states(self) -> list[dict[str, Any]]:
        """Return their states."""
        states: list[dict[str, Any]] = self.env.get_state()
        return states

    def among_good(self, bad: Any, good: Any, which: int) -> list[Any]:
        """Return it in one place, and where a list is expected."""
        return [[bad if which % N == i else good for i in range(N)], bad]

    def looks_right(self, pictures: Any) -> bool:
        """Return whether they are pictures."""
        return [picture.shape for picture in pictures] == [(24, 32, 3)] * N

    def told(self, i: int, model: Model, observations: Any, infos: dict[str, Any]) -> None:
        """Check what reset and step return of environment i."""
        assert self.env.single_observation_space.contains(observations[i]) and model.is_seen(observations[i])
        assert {key: infos[key][i] for key in model.info} == model.info
        assert all(infos[f"_{key}"][i] for key in model.info)

    @initialize(begun=st.booleans())
    def begin(self, begun: bool) -> None:
        """Start with a reset, or not."""
        if begun:
            self.reset(0, None, 0)

    @rule(seed=seeds | st.lists(seeds | st.none(), min_size=N, max_size=N), hole=holes, mask=index)
    def reset(self, seed: Any, hole: int | None, mask: int) -> None:
        """All or some, with one seed, several or none, on chosen holes."""
        seed = seed if self.has_begun or isinstance(seed, int) else [one or 0 for one in seed]
        chosen = np.array([mask >> i & 1 for i in range(N)], np.bool_)
        options: dict[str, Any] = {"reset_mask": chosen} if chosen.any() else {}
        if hole is not None and self.game.key is not None:
            options[self.game.key] = [hole] * N if mask & 8 else hole
        if not self.has_begun and 0 < chosen.sum() < N:
            return self.refused(self.env.reset, seed=seed, options=options)
        for i in np.flatnonzero(chosen) if chosen.any() else range(N):
            own = seed + int(i) if isinstance(seed, int) else seed[i]
            self.models[i].reset(own, hole if self.game.key else None)
        observations, infos = self.env.reset(seed=seed, options=options)
        assert infos.keys() == {name for key in self.models[0].info for name in (key, f"_{key}")}
        for i, model in enumerate(self.models):
            self.told(i, replace(model, last=("tee", 0.0, 0)), observations, infos)

    @rule(several=st.lists(st.lists(putts, min_size=N, max_size=N), min_size=1, max_size=4))
    def step(self, several: list[list[Any]]) -> None:
        """Play, each mode in its way."""
        for each in several:
            self.play([model.aim(putt) for model, putt in zip(self.models, each, strict=True)])

    def play(self, each: list[Any]) -> None:
        """Play one putt each."""
        if not self.has_begun or (self.mode == "Disabled" and any(model.over for model in self.models)):
            return self.refused(self.env.step, each)
        idle = np.array([model.over for model in self.models])
        for model, putt in zip(self.models, each, strict=True):
            model.reset(None) if model.over else model.step(putt)
        observations, rewards, terminated, truncated, infos = self.env.step(each)
        over = [model.over for model in self.models]
        assert (terminated.tolist(), truncated.any()) == (over, False)
        assert np.isfinite(rewards).all() and not rewards[idle].any()
        assert self.game.reward == "shaped" or rewards.tolist() == (idle - 1.0).tolist()
        for i, model in enumerate(self.models):
            if self.mode == "SameStep" and model.over:
                self.told(i, model, infos["final_obs"], infos["final_info"])
                assert infos["_final_obs"][i] and infos["_final_info"][i]
                model.reset(None)
            self.told(i, model, observations, infos)
        assert ("final_obs" in infos) == (self.mode == "SameStep" and any(over))

    @rule(which=st.lists(index, min_size=N, max_size=N))
    def set_state(self, which: list[int]) -> None:
        """Go on from kept states, of whichever environment they were."""
        states = [self.kept[k % len(self.kept)] for k in which]
        if self.mode == "SameStep" and any(state.get("over") for state in states):
            return self.refused(self.env.set_state, states)
        self.env.set_state(states)
        now = self.env.get_state()
        for i, model in enumerate(self.models):
            model.enter(states[i] if "np_random" in states[i] or model.rng is not None else now[i])


def run(machine: Callable[[], Play], sequences: int) -> None:
    """Try so many sequences."""
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=sequences, stateful_step_count=STEPS, deadline=None, suppress_health_check=slow),
    )


@pytest.mark.parametrize("rules", RULES, ids=IDS)
def test_calls_of_an_environment_agree_with_the_model(rules: Rules) -> None:
    """Any sequence, for each set of rules."""
    run(partial(Alone, rules, {}), -(-SEQUENCES // (2 * len(RULES))))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("rules", RULES, ids=IDS)
def test_calls_of_a_batch_agree_with_the_model(rules: Rules, mode: str) -> None:
    """Any sequence, in every autoreset mode."""
    run(partial(Together, rules, mode, {}), -(-SEQUENCES // (2 * len(RULES) * len(MODES))))


@pytest.mark.parametrize("rules", RULES[-2:], ids=IDS[-2:])
def test_rendering_between_calls_changes_nothing(rules: Rules, gl: None) -> None:
    """For one environment and a batch."""
    show = {"render_mode": "rgb_array", "render_size": (32, 24), "render_profile": "fast"}
    run(partial(Alone, rules, show), max(1, SEQUENCES // 100))
    run(partial(Together, rules, "SameStep", show), max(1, SEQUENCES // 100))
