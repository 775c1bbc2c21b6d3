"""Environments on procedural levels: sets, selected levels, states, batches."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.samplers import MAX_NUM_LEVELS, LevelSampler
from tests.envs.vector_parity import VectorParity


def make(**options: Any) -> MiniGolfEnv:
    """Return an environment on levels."""
    return MiniGolfEnv("procedural", **options)


def numbers(levels: LevelSampler, n: int = 2000) -> set[int]:
    """Return levels sampled from a set whose tasks are their numbers."""
    rng = np.random.default_rng(0)
    return {levels.sample(rng, None) for _ in range(n)}  # type: ignore[misc]


def test_level_sets_do_not_overlap() -> None:
    """A set is all of start_level ... start_level + num_levels - 1; num_levels = 0 stands for all levels."""
    train = numbers(LevelSampler(lambda n: n, 0, 50))  # type: ignore[arg-type, return-value]
    test = numbers(LevelSampler(lambda n: n, 50, 20))  # type: ignore[arg-type, return-value]
    assert train == set(range(50)) and test == set(range(50, 70))
    everything = numbers(LevelSampler(lambda n: n, 50, 0))  # type: ignore[arg-type, return-value]
    assert len(everything) > 1990 and min(everything) < MAX_NUM_LEVELS / 100 and max(everything) > 0.99 * MAX_NUM_LEVELS


def test_reset_draws_a_level() -> None:
    """A seed gives the same levels again, which come from the environment's generator; info names them."""
    env, copied = make(num_levels=20, start_level=100), make(num_levels=20, start_level=100)
    first = [env.reset(seed=4 if k == 0 else None)[1] for k in range(12)]
    again = [copied.reset(seed=4 if k == 0 else None)[1] for k in range(12)]
    assert first == again
    levels = [info["level"] for info in first]
    assert all(type(level) is int and 100 <= level < 120 for level in levels) and len(set(levels)) > 4
    assert (
        first[0]["course"]
        == f"procedural-v1-easy-{levels[0]}"
        == env.task.course.name.replace(str(env.task.index), str(levels[0]))
    )


def test_reset_option_selects_a_level() -> None:
    """The level may be outside the set; the next reset draws a level again."""
    env = make(num_levels=1, difficulty="medium", observation="rays")
    observation, info = env.reset(seed=0, options={"level": 17})
    assert info["level"] == 17 and info["course"] == "procedural-v1-medium-17"
    assert env.observation_space.contains(observation)
    assert env.reset()[1]["level"] == 0
    place = tuple(np.append(env.task.course.tee.centre, env.task.course.ball_radius))
    env.reset(options={"level": 0, "position": place})
    assert env.get_state()["position"] == place


def test_state_includes_the_level() -> None:
    """Another environment resumes it with the same bits; so does an unpickled copy."""
    env, other = make(difficulty="hard", num_levels=3), make(difficulty="hard", num_levels=1)
    env.reset(seed=8, options={"level": 2})
    env.step([0.4, 0.2])
    state = env.get_state()
    assert state["level"] == 2
    other.reset(seed=0)
    other.set_state(state)
    copy = pickle.loads(pickle.dumps(env))  # noqa: S301 (our own)
    putts = np.random.default_rng(0).uniform(-1, 1, (8, 2))
    for copied in (other, copy):
        assert copied.what_if(putts).position.tobytes() == env.what_if(putts).position.tobytes()
    played = [copied.step([0.3, -0.5]) for copied in (env, other, copy)]
    assert len({step[0].tobytes() for step in played}) == 1 and played[0][1:] == played[1][1:] == played[2][1:]


@pytest.mark.parametrize("observation", ["state", "rays"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_batch_on_levels_equals_single_environments_bitwise(mode: str, observation: str) -> None:
    """Environment i is a single environment seeded with seed + i, each on its own levels."""
    options: dict[str, Any] = {"difficulty": "medium", "num_levels": 6, "max_strokes": 2, "observation": observation}
    pair = VectorParity(mode, 5, seed=7, course="procedural", **options)
    assert len({state["level"] for state in pair.batch.get_state()}) > 1
    pair.play(7)


def test_batch_plays_selected_levels() -> None:
    """A batch takes one level for all or one each; environments that are not reset continue."""
    batch = MiniGolfVectorEnv(3, "procedural", num_levels=4, autoreset_mode="Disabled")
    assert batch.reset(seed=0, options={"level": [9, 11, 9]})[1]["level"].tolist() == [9, 11, 9]
    mask = np.array([False, True, False])
    infos = batch.reset(options={"reset_mask": mask, "level": 30})[1]
    assert infos["level"][1] == 30 and infos["_level"].tolist() == [False, True, False]
    for wrong in ([1, 2], [1, 2, -1], "first", 0.5):
        with pytest.raises(ValueError, match="level: expected"):
            batch.reset(options={"level": wrong})
    assert batch.step(np.zeros((3, 2)))[-1]["level"].tolist() == [9, 30, 9]


def test_frames_show_the_level_being_played() -> None:
    """Each frame of rgb_array_list shows the level that was played then."""
    options: dict[str, Any] = {"render_size": (64, 48), "camera": "top", "render_profile": "fast"}
    lists, single = make(render_mode="rgb_array_list", **options), make(render_mode="rgb_array", **options)
    lists.reset(seed=0, options={"level": 1})
    lists.step([0.1, 0.0])
    frames = lists.render()
    lists.reset(options={"level": 2})
    lists.step([0.1, 0.0])
    frames += lists.render()
    expected = []
    for level in (1, 2):
        single.reset(seed=0, options={"level": level})
        expected.append(single.render())
    assert np.array_equal(frames[0], expected[0]) and not np.array_equal(expected[0], expected[1])
    assert any(np.abs(frame.astype(int) - expected[1]).mean() < 2.0 for frame in frames)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"difficulty": "meduim"}, "difficulty: expected one of .* did you mean 'medium'"),
        ({"start_level": -1}, "start_level: expected an integer from 0 to 2147483647, received -1"),
        ({"start_level": 1.5}, "start_level: expected an integer"),
        ({"num_levels": True}, "num_levels: expected an integer"),
        ({"start_level": 2**31 - 5, "num_levels": 6}, "num_levels: expected at most 5 from level 2147483643 on"),
        ({"course": "dogleg", "num_levels": 3}, "num_levels: expected with course='procedural' only"),
        ({"cup_radius": 0.5}, "cup radius: expected at most 0.2 m"),
        ({"reward": "sparse"}, "reward"),
    ],
)
def test_level_argument_error_names_the_argument(options: dict[str, Any], message: str) -> None:
    """The error is raised when the environment is made, not at its first reset."""
    with pytest.raises(ValueError, match=message):
        MiniGolfEnv(**({"course": "procedural"} | options))


@pytest.mark.parametrize("level", [-1, 2**31, 1.5, "17", True, None])
def test_reset_rejects_invalid_level(level: Any) -> None:
    """The environment stays as it was."""
    env = make(num_levels=2)
    before = env.reset(seed=1)[1]
    if level is None:
        with pytest.raises(ValueError, match="position: expected with a 'level'"):
            env.reset(options={"position": env.get_state()["position"]})
    else:
        with pytest.raises(ValueError, match="level: expected an integer from 0"):
            env.reset(seed=5, options={"level": level})
    assert env.step([0.0, 0.0])[-1]["level"] == before["level"]
    with pytest.raises(ValueError, match="level: expected none on the course 'dogleg'"):
        MiniGolfEnv().reset(options={"level": 1})
