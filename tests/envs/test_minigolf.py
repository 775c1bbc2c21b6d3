"""MiniGolf-v0 as Gymnasium and stable-baselines3 expect it, and as the class docstring describes it."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import minigolf_env  # noqa: F401 (registers the environment)
from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.config import UnseenLevelWarning

ROOT = Path(__file__).parents[2]


def play(env: MiniGolfEnv, putts: int, seed: int) -> list[Any]:
    """Return all results of random putts and resets."""
    env.action_space.seed(seed)
    seen: list[Any] = [env.reset(seed=seed)]
    for _ in range(putts):
        seen.append(env.step(env.action_space.sample()))
        if seen[-1][2]:
            seen.append(env.reset())
    return seen


def same(a: Any, b: Any) -> bool:
    """Return true if two structures of arrays and values are equal bit for bit."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


@pytest.fixture
def env() -> MiniGolfEnv:
    """Return the default hole with a ball on the tee."""
    made = MiniGolfEnv()
    made.reset(seed=3)
    return made


@pytest.mark.parametrize("reward", ["strokes", "shaped"])
def test_environment_checkers_accept_the_environment(reward: str) -> None:
    """Gymnasium's and stable-baselines3's checkers find nothing; a warning would be an error here."""
    check_env(gym.make("MiniGolf-v0", reward=reward).unwrapped, skip_render_check=True)  # There is no display.
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(gym.make("MiniGolf-v0", reward=reward))


def test_fresh_process_makes_environment_by_module_name() -> None:
    """gym.make("minigolf_env:MiniGolf-v0") needs no import."""
    code = "import gymnasium as gym; print(gym.make('minigolf_env:MiniGolf-v0').reset(seed=0)[1]['status'])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "tee"


def test_same_seed_gives_same_bits() -> None:
    """Two environments with one seed agree in every bit, putt noise included."""
    options: dict[str, Any] = {"putt_noise": (0.5, 0.015)}
    assert same(play(MiniGolfEnv(**options), 30, seed=5), play(MiniGolfEnv(**options), 30, seed=5))
    assert not same(play(MiniGolfEnv(**options), 3, seed=5), play(MiniGolfEnv(**options), 3, seed=6))


def test_reset_and_step_return_plain_types(env: MiniGolfEnv) -> None:
    """The reward is a float, the flags are bools, the observation is a new float32 array in its space."""
    first, reward, terminated, truncated, info = env.step(np.array([0.1, 0.0], dtype=np.float32))
    second = env.step(np.array([0.1, 0.0], dtype=np.float32))[0]
    assert type(reward) is float and type(terminated) is bool and type(truncated) is bool
    assert first.dtype == np.float32 and not np.shares_memory(first, second)
    assert env.observation_space.contains(first)
    assert [type(info[key]) for key in ("strokes", "is_success", "status", "shot_time", "bounces", "course")] == [
        int,
        bool,
        str,
        float,
        int,
        str,
    ]


def test_set_state_repeats_an_episode_bitwise(env: MiniGolfEnv) -> None:
    """The same putts from the same state give the same bits, also in another environment."""
    state = env.get_state()
    action = np.array([0.4, 0.3], dtype=np.float32)
    expected = [env.step(action), env.step(action), env.reset()]
    other = MiniGolfEnv()
    other.reset(seed=99)
    for player in (env, other):
        player.set_state(state)
        assert same(expected, [player.step(action), player.step(action), player.reset()])


@pytest.mark.parametrize(
    ("state", "word"),
    [
        ({"position": (0.6, 0.6, 0.0)}, "free space"),
        ({"position": (np.nan, 0.6, 0.1)}, "finite"),
        ({"position": (0.6, 0.6)}, "shape"),
        ({"position": (50.0, 50.0, 1.0)}, "bounds"),
        ({"position": (0.6, 0.6, 0.1), "strokes": 11}, "strokes"),
        ({"position": (0.6, 0.6, 0.1), "strokes": 1.5}, "strokes"),
        (
            {"position": (0.6, 0.6, 0.1), "strokes": 10},
            "strokes: expected an integer from 0 to 9, received 10; after 10",
        ),
        ({"position": (0.6, 0.6, 0.1), "strokes": 11, "over": True}, "strokes: expected an integer from 0 to 10"),
        ({"position": (0.6, 0.6, 0.1), "strokes": True}, "strokes: expected an integer from 0 to 9, received True"),
        ({"position": (0.6, 0.6, 0.1), "strokes": np.ones(2)}, "strokes: expected an integer"),
        ({"position": (0.6, 0.6, 0.1), "over": 1}, "over: expected True or False, received 1"),
        ({"position": (0.6, 0.6, 0.1), "over": "no"}, "over: expected True or False"),
        ({"position": (0.6, 0.6, 0.1), "over": None}, "over: expected True or False"),
        ({"strokes": 1}, "position"),
        ({"position": (0.6, 0.6, 0.1), "stroke": 1}, "stroke"),
        ([0.6, 0.6, 0.1], "state: expected 'position'"),
        ({"position": (np.nan, 0.6, 0.1), "over": True}, "finite"),
        ({"position": (0.6, 0.6, 0.1), "np_random": {"bit_generator": "MT19937"}}, "np_random"),
        (
            {"position": (0.6, 0.6, 0.1), "np_random": np.random.PCG64(0).state | {"state": {"state": 1.5, "inc": 1}}},
            "np_random: expected a state of numpy's PCG64",
        ),
        ({"position": (0.6, 0.6, 10**400)}, "position: expected numbers"),
    ],
)
def test_invalid_state_is_rejected_and_changes_nothing(env: MiniGolfEnv, state: dict[str, Any], word: str) -> None:
    """set_state sets all of a state or nothing."""
    before = env.get_state()
    with pytest.raises(ValueError, match=word):
        env.set_state(state)
    assert env.get_state() == before


BAD_ACTIONS: list[Any] = [[np.nan, 0.0], [np.inf, 0.0], [0.1], [[0.1, 0.2]], "left", [0.1, 0.2, 0.3], None]
NO_NUMBERS: list[Any] = [["0.1", "0.2"], [10**400, 0], np.array([0.1j, 0.2]), np.array(["2020", "2021"], "M8[Y]")]
"""Values that numpy would read as numbers, with or without a warning, or reject with another kind of error."""


@pytest.mark.parametrize("action", BAD_ACTIONS + NO_NUMBERS)
def test_invalid_action_is_rejected_and_changes_nothing(env: MiniGolfEnv, action: Any) -> None:
    """An action of a wrong shape or value raises an error."""
    before = env.get_state()
    with pytest.raises(ValueError, match="action"):
        env.step(action)
    assert env.get_state() == before


@pytest.mark.parametrize("options", [5, "tee", [("position", (0.6, 0.6, 0.1))], {"tee": 1}, {5: 1, "tee": 2}])
def test_invalid_reset_options_are_rejected_and_change_nothing(env: MiniGolfEnv, options: Any) -> None:
    """Valid options are None or a dict of known keys; in a batch, too."""
    before, batch = env.get_state(), MiniGolfVectorEnv(2)
    for some in (env, batch):
        with pytest.raises(ValueError, match="options: expected"):
            some.reset(seed=1, options=options)
    assert env.get_state() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"course": "dogleh"}, "did you mean 'dogleg'"),
        ({"course": "room"}, "cup"),
        ({"reward": "shape"}, "did you mean 'shaped'"),
        ({"observation": "stat"}, "did you mean 'state'"),
        ({"tee": "randon"}, "did you mean 'random'"),
        ({"max_strokes": 0}, "max_strokes"),
        ({"max_strokes": True}, "max_strokes"),
        ({"max_strokes": 2.5}, "max_strokes"),
        ({"top_speed": -1.0}, "top_speed"),
        ({"cup_radius": 0.01}, "cup"),
        ({"putt_noise": (-1.0, 0.0)}, "putt_noise"),
        ({"putt_noise": 0.1}, "putt_noise"),
        ({"dt": 0.0}, "dt"),
        ({"dt": np.nan}, "dt"),
        ({"impact": "elastic"}, "impact: expected one of 'average', 'conservative'"),
        ({"impact": ["average"]}, "impact: expected one of"),
        ({"course": "roundd"}, "did you mean 'round'"),
        ({"course": "procedual"}, "did you mean 'procedural'"),
    ],
)
def test_argument_error_names_the_argument(options: dict[str, Any], words: str) -> None:
    """A wrong argument raises a ValueError that names it."""
    with pytest.raises(ValueError, match=words):
        MiniGolfEnv(**options)


@pytest.mark.parametrize("course", ["dogleg", "round", "procedural"])
def test_unknown_argument_is_a_type_error(course: str) -> None:
    """The names of internal fields are unknown arguments, too."""
    for options in ({"level": 17}, {"hole": 3}, {"random_tee": True}):
        for make in (
            lambda **given: MiniGolfEnv(course, **given),
            lambda **given: MiniGolfVectorEnv(2, course, **given),
        ):
            with pytest.raises(TypeError, match=f"^got an unexpected keyword argument '{next(iter(options))}'"):
                make(**options)


@pytest.mark.parametrize("options", [{"num_envs": 2}, {"autoreset_mode": "Disabled"}])
def test_single_environment_rejects_vector_arguments(options: dict[str, Any]) -> None:
    """The error says which kind of environment has the argument."""
    with pytest.raises(TypeError, match=f"^got an unexpected keyword argument '{next(iter(options))}'.*make_vec"):
        MiniGolfEnv(**options)


@pytest.mark.parametrize("over", [True, np.True_])
def test_state_after_the_last_stroke_is_over(over: Any) -> None:
    """A state after all strokes can be set, and reports that the episode is over."""
    env = MiniGolfEnv()
    env.set_state({"position": (0.6, 0.6, 0.1), "strokes": 10, "over": over})
    state = env.get_state()
    assert state["strokes"] == 10 and state["over"] is True
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2))


def test_step_before_reset_and_after_the_end_asks_for_reset() -> None:
    """A step before the first reset or after the end raises ResetNeeded."""
    env = MiniGolfEnv(max_strokes=np.int64(1))  # type: ignore[arg-type]
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2))
    env.reset(seed=0)
    assert env.step(np.zeros(2))[2]
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2))


def test_last_stroke_terminates_the_episode() -> None:
    """The episode is terminated, not truncated, and observations contain the strokes left."""
    env = MiniGolfEnv(max_strokes=3)
    observation, _ = env.reset(seed=0)
    left = [observation[-1]]
    ends = []
    for _ in range(3):
        observation, _, terminated, truncated, info = env.step(np.array([-0.01, 0.0]))
        left.append(observation[-1])
        ends.append((terminated, truncated))
    assert np.allclose(left, [1.0, 2 / 3, 1 / 3, 0.0])
    assert ends == [(False, False), (False, False), (True, False)]
    assert info["strokes"] == 3 and not info["is_success"]


def test_tee_is_random_or_fixed() -> None:
    """Random starts fill the tee box; the fixed start is its middle."""
    env = MiniGolfEnv()
    tee = env.task.course.tee
    starts = np.array([env.reset(seed=seed) and env.get_state()["position"][:2] for seed in range(200)])
    assert (starts >= tee.lower).all() and (starts <= tee.upper).all()
    assert (np.ptp(starts, axis=0) > 0.9 * (np.array(tee.upper) - tee.lower)).all()
    fixed = MiniGolfEnv(tee="fixed")
    fixed.reset(seed=1)
    assert np.allclose(fixed.get_state()["position"][:2], np.add(tee.lower, tee.upper) / 2)


def test_ball_that_drops_into_the_cup_is_holed() -> None:
    """A soft putt next to the cup ends the episode with success, and the ball is below the rim."""
    env = MiniGolfEnv()
    x, y, rim = env.task.cup.position
    env.reset(options={"position": (x - 0.15, y, rim + env.task.world.ball_radius)})
    speed = 0.9 / env.task.top_speed
    _, reward, terminated, _, info = env.step(np.array([speed, 0.0]))
    assert terminated and info["is_success"] and info["status"] == "holed" and info["strokes"] == 1
    assert env.get_state()["position"][2] < rim
    assert reward > -1.0


def test_what_if_predicts_step_bitwise(env: MiniGolfEnv) -> None:
    """what_if returns what step does next, and moves nothing."""
    putts = np.random.default_rng(0).uniform(-1, 1, (20, 2)).astype(np.float32)
    before = env.get_state()
    outcome = env.what_if(putts)
    assert env.get_state() == before
    for putt, position, holed in zip(putts, outcome.position, outcome.holed, strict=True):
        env.set_state(before)
        info = env.step(putt)[4]
        assert env.get_state()["position"] == tuple(position)
        assert info["is_success"] == holed


def test_putt_noise_has_the_given_standard_deviations() -> None:
    """Noise turns the direction and scales the speed of putts."""
    env = MiniGolfEnv(putt_noise=(2.0, 0.05), top_speed=2.0)
    rngs = [np.random.default_rng(seed) for seed in range(4000)]
    launched = env.task.launch_velocity(np.tile([0.5, 0.0], (4000, 1)), env.task.sample_noise(rngs))
    degrees = np.degrees(np.arctan2(launched[:, 1], launched[:, 0]))
    speeds = np.hypot(launched[:, 0], launched[:, 1])
    assert degrees.std() == pytest.approx(2.0, rel=0.05) and abs(degrees.mean()) < 0.1
    assert speeds.std() == pytest.approx(0.05, rel=0.05) and speeds.mean() == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("num_envs", "gymnasium.make_vec"),
        ("n_envs", "gymnasium.make_vec"),
        ("frameskip", "expected one of 'course', 'render_mode'"),
        ("seed", r"reset\(seed=...\)"),
        ("width", "render_size"),
        ("max_stroke", "did you mean 'max_strokes'"),
        ("num_env", "gymnasium.make_vec"),
        ("render_modes", "did you mean 'render_mode'"),
        ("render_fps", "render_speed is the speed of the putts"),
        ("level", r"reset\(options={\"level\": 17}\)"),
        ("hole", r"reset\(options={\"hole\": 3}\)"),
    ],
)
def test_unknown_argument_of_gym_make_is_named_as_python_does(name: str, advice: str) -> None:
    """Clients such as TorchRL recognise Python's phrase; the advice follows."""
    with pytest.raises(TypeError, match=f"got an unexpected keyword argument '{name}'.*{advice}"):
        gym.make("MiniGolf-v0", **{name: 3})
    with pytest.raises(TypeError, match=r"got an unexpected keyword argument 'max_episode_steps'.*max_strokes"):
        gym.make_vec("MiniGolf-v0", num_envs=2, max_episode_steps=5)


def test_level_that_an_agent_cannot_see_is_a_warning() -> None:
    """The observation "state" of levels shows no wall; other observations and holes give no warning."""
    with pytest.warns(UnseenLevelWarning, match="hides the level"):
        MiniGolfEnv("procedural")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MiniGolfEnv("procedural", observation="rays")
        MiniGolfEnv("round")
