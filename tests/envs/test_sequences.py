"""Any sequence of calls, good ones and bad ones, does what a small model says; a refused one changes nothing.

SEQUENCES=100000 tries so many instead of 1,000 (make fuzz).
"""

from __future__ import annotations

import copy
import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar

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

BAD_STATES: list[dict[str, Any]] = [
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

putts = st.sampled_from(PUTTS) | st.tuples(st.floats(-1, 1), st.floats(-1, 1))
modes = st.sampled_from(["NextStep", "SameStep", "Disabled"])
index = st.integers(0, 99)
seeds, holes = st.integers(0, 5), st.none() | st.integers(1, 9)


class Play(RuleBasedStateMachine):
    """What both machines share: calls that are refused, and states that are kept."""

    env: Any = None
    models: list[Model]
    pictures: ClassVar[dict[str, Any]] = {"render_mode": None}

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[dict[str, Any]] = []

    @property
    def has_begun(self) -> bool:
        """Whether there are balls."""
        return self.models[0].rng is not None

    @property
    def game(self) -> Rules:
        """The options."""
        return self.models[0].rules

    def states(self) -> list[dict[str, Any]]:
        """Return the states of all environments."""
        raise NotImplementedError

    def refused(self, call: Callable[..., Any], *arguments: Any, **named: Any) -> None:
        """Check that a call raises an error of one line; that nothing has changed is checked after each rule."""
        with pytest.raises((ValueError, gym.error.Error)) as caught:
            call(*arguments, **named)
        assert "\n" not in str(caught.value) and len(str(caught.value)) > 20

    @invariant()
    def states_are_the_models(self) -> None:
        """To the last bit, the random numbers included."""
        if self.env is None:
            return
        if self.has_begun:
            assert self.states() == [model.state for model in self.models]
        else:
            with pytest.raises(ResetNeeded):
                self.states()

    @rule(which=index)
    def keep(self, which: int) -> None:
        """Keep a state of one environment, or one of a position alone."""
        model = self.models[which % len(self.models)]
        if self.has_begun:
            self.kept.append(model.state)
        number = {} if model.rules.key is None else {model.rules.key: model.rules.first}
        above = replace(model, hole=model.rules.first).above_the_tee
        self.kept.append({"position": above, **number})

    @rule(options=st.sampled_from(BAD_OPTIONS))
    def reset_badly(self, options: Any) -> None:
        """Options that no course takes."""
        self.refused(self.env.reset, seed=1, options=options)

    @rule(seed=st.sampled_from(BAD_SEEDS))
    def seed_badly(self, seed: Any) -> None:
        """Seeds that are none."""
        self.refused(self.env.reset, seed=seed)

    @rule()
    def close(self) -> None:
        """As often as one likes; what goes on after it is the same."""
        self.env.close()

    @rule(how=st.sampled_from(["pickle", "deepcopy"]))
    def go_on_with_a_copy(self, how: str) -> None:
        """A copy plays on with the same bits."""
        env = self.env
        self.env = copy.deepcopy(env) if how == "deepcopy" else pickle.loads(pickle.dumps(env))  # noqa: S301 (ours)


class Alone(Play):
    """One environment."""

    def states(self) -> list[dict[str, Any]]:
        """Return its state."""
        return [self.env.get_state()]

    @property
    def model(self) -> Model:
        """What it should be."""
        return self.models[0]

    @initialize(rules=st.sampled_from(RULES), begun=st.booleans())
    def make(self, rules: Rules, begun: bool) -> None:
        """Make it, and reset it or not."""
        self.env, self.models = MiniGolfEnv(**rules.options, **self.pictures), [Model(rules)]
        self.keep(0)
        if begun:
            self.reset(0, None, False)

    def told(self, observation: Any, info: dict[str, Any]) -> None:
        """Check what reset and step return."""
        assert self.env.observation_space.contains(observation) and self.model.is_seen(observation)
        assert info == self.model.info
        assert [type(value) for value in info.values()] == [type(value) for value in self.model.info.values()]

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

    @rule(several=st.lists(putts, min_size=1, max_size=3))
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

    @rule(putt=st.sampled_from(BAD_PUTTS))
    def play_badly(self, putt: Any) -> None:
        """What is no putt is refused, by what_if too."""
        self.refused(self.env.step, putt)
        self.refused(self.env.what_if, putt if putt is None else [putt])

    @rule(putts=st.lists(putts, max_size=3))
    def what_if(self, putts: list[Any]) -> None:
        """Foretell without moving the ball."""
        putts = [self.models[0].aim(putt) for putt in putts]
        actions = np.array(putts, float).reshape(-1, 2)
        if not self.has_begun:
            return self.refused(self.env.what_if, actions)
        outcome = self.env.what_if(actions)
        calm = replace(self.game, putt_noise=(0.0, 0.0))
        for putt, position, holed in zip(putts, outcome.position, outcome.holed, strict=True):
            twin = replace(self.model, rules=calm, over=False)
            twin.step(putt)
            assert (tuple(position), holed) == (twin.position, twin.info["is_success"])

    @rule(which=index)
    def set_state(self, which: int) -> None:
        """Go on from a kept state."""
        state = self.kept[which % len(self.kept)]
        before = copy.deepcopy(state)
        self.env.set_state(state)
        assert state == before
        self.model.enter(state if "np_random" in state or self.has_begun else self.env.get_state())

    @rule(which=index, wrong=st.sampled_from([*BAD_STATES, "left"]))
    def set_state_badly(self, which: int, wrong: Any) -> None:
        """All or nothing."""
        state = {**self.kept[which % len(self.kept)], "over": False, **wrong} if isinstance(wrong, dict) else wrong
        self.refused(self.env.set_state, state)

    @rule()
    def render(self) -> None:
        """Return what the render mode promises."""
        if not self.has_begun:
            return self.refused(self.env.render)
        picture = self.env.render()
        if self.pictures["render_mode"] is None:
            assert picture is None
        else:
            assert picture.shape == (24, 32, 3) and picture.dtype == np.uint8


class Together(Play):
    """A batch."""

    @initialize(rules=st.sampled_from(RULES), mode=modes, begun=st.booleans())
    def make(self, rules: Rules, mode: str, begun: bool) -> None:
        """Make it, and reset it or not."""
        self.env, self.mode = MiniGolfVectorEnv(N, autoreset_mode=mode, **rules.options, **self.pictures), mode
        self.models = [Model(rules) for _ in range(N)]
        self.keep(0)
        if begun:
            self.reset(0, None, 0)

    def states(self) -> list[dict[str, Any]]:
        """Return their states."""
        states: list[dict[str, Any]] = self.env.get_state()
        return states

    def told(self, i: int, model: Model, observations: Any, infos: dict[str, Any], space: str = "single_") -> None:
        """Check what reset and step return of environment i."""
        assert self.env.single_observation_space.contains(observations[i]) and model.is_seen(observations[i])
        assert {key: infos[key][i] for key in model.info} == model.info
        assert all(infos[f"_{key}"][i] for key in model.info)

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
            told = model if not chosen.any() or chosen[i] else replace(model, last=("tee", 0.0, 0))
            self.told(i, told, observations, infos)

    @rule(several=st.lists(st.lists(putts, min_size=N, max_size=N), min_size=1, max_size=3))
    def step(self, several: list[list[Any]]) -> None:
        """Play, each mode in its way."""
        for each in several:
            self.play([model.aim(putt) for model, putt in zip(self.models, each, strict=True)])

    def play(self, putts: list[Any]) -> None:
        """Play one putt each."""
        if not self.has_begun or (self.mode == "Disabled" and any(model.over for model in self.models)):
            return self.refused(self.env.step, putts)
        idle = [model.over for model in self.models]
        for model, putt in zip(self.models, putts, strict=True):
            model.reset(None) if model.over else model.step(putt)
        observations, rewards, terminated, truncated, infos = self.env.step(putts)
        over = [model.over for model in self.models]
        assert (terminated.tolist(), truncated.any()) == (over, False) and np.isfinite(rewards).all()
        assert self.game.reward == "shaped" or rewards.tolist() == [idle[i] - 1.0 for i in range(N)]
        for i, model in enumerate(self.models):
            if self.mode == "SameStep" and model.over:
                self.told(i, model, infos["final_obs"], infos["final_info"])
                assert infos["_final_obs"][i] and infos["_final_info"][i]
                model.reset(None)
            self.told(i, model, observations, infos)
        assert ("final_obs" in infos) == (self.mode == "SameStep" and any(over))

    @rule(putt=st.sampled_from(BAD_PUTTS), i=st.integers(0, N - 1))
    def play_badly(self, putt: Any, i: int) -> None:
        """One that is no putt refuses them all."""
        for putts in ([putt if i == k else [0.1, 0.2] for k in range(N)], putt):
            self.refused(self.env.step, putts)
            self.refused(self.env.what_if, putts if putts is putt else [[one] for one in putts])

    @rule(putts=st.lists(putts, max_size=2))
    def what_if(self, putts: list[Any]) -> None:
        """Foretell the same putts for all, without moving a ball."""
        putts = [self.models[0].aim(putt) for putt in putts]
        actions = np.array(putts, float).reshape(-1, 2)
        if not self.has_begun:
            return self.refused(self.env.what_if, actions)
        outcome = self.env.what_if(actions)
        for i, model in enumerate(self.models):
            for k, putt in enumerate(putts):
                twin = replace(model, rules=replace(self.game, putt_noise=(0.0, 0.0)), over=False)
                twin.step(putt)
                assert (tuple(outcome.position[i, k]), outcome.holed[i, k]) == (twin.position, twin.info["is_success"])

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

    @rule(which=index, wrong=st.sampled_from([*BAD_STATES, "left"]), i=st.integers(0, N - 1))
    def set_state_badly(self, which: int, wrong: Any, i: int) -> None:
        """One that is wrong refuses them all."""
        good = {**self.kept[which % len(self.kept)]}
        bad = {**good, "over": False, **wrong} if isinstance(wrong, dict) else wrong
        self.refused(self.env.set_state, [bad if i == k else good for k in range(N)])
        self.refused(self.env.set_state, good)

    @rule()
    def render(self) -> None:
        """Return what the render mode promises."""
        if not self.has_begun:
            return self.refused(self.env.render)
        pictures = self.env.render()
        if self.pictures["render_mode"] is None:
            assert pictures is None
        else:
            assert [picture.shape for picture in pictures] == [(24, 32, 3)] * N


def run(machine: type[Play], sequences: int) -> None:
    """Try so many sequences."""
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=sequences, stateful_step_count=STEPS, deadline=None, suppress_health_check=slow),
    )


@pytest.mark.parametrize("machine", [Alone, Together])
def test_sequences_of_calls(machine: type[Play]) -> None:
    """Whatever their order."""
    run(machine, SEQUENCES // 2)


@pytest.mark.parametrize("machine", [Alone, Together])
def test_sequences_with_pictures(machine: type[Play], gl: None) -> None:
    """Looking on changes nothing."""
    show = {"render_mode": "rgb_array", "render_size": (32, 24), "render_profile": "fast"}
    run(type("Shown", (machine,), {"pictures": show}), max(1, SEQUENCES // 100))
