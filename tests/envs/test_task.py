"""The rules of the game."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely

from minigolf_env.envs import Task
from minigolf_env.envs.config import build_task
from minigolf_env.envs.observations.state import STATE_FEATURES, state_space
from minigolf_env.envs.rewards import shaped_reward, shaping_potential, strokes_reward
from minigolf_env.envs.task import Outcome, Result, action_space, stack_tasks


@pytest.fixture(scope="module")
def task() -> Task:
    """Return the task of the default hole."""
    return build_task()


def test_action_longer_than_one_is_a_full_putt(task: Task) -> None:
    """The length of an action is clipped to 1, its direction kept."""
    launched = task.launch_velocity(np.array([[0.3, 0.4], [3.0, 4.0], [0.0, 0.0], [1.0, 1.0]]))
    assert np.allclose(np.linalg.norm(launched, axis=1), np.array([0.5, 1.0, 0.0, 1.0]) * task.top_speed)
    assert np.allclose(launched[1], 2.0 * launched[0])
    assert (launched[:, 2] == 0.0).all()


def test_ball_below_the_rim_is_holed_only_without_energy_to_leave(task: Task) -> None:
    """The energy must not lift its centre one radius above the rim."""
    x, y, rim = task.cup.position
    position = np.array([x, y, rim - 0.05])
    radius, g = task.world.ball_radius, 9.81
    escape = np.sqrt(2.0 * g * (0.05 + radius))
    up = np.array([0.0, 0.0, 1.0])
    assert task.is_holed(position, 0.99 * escape * up)
    assert not task.is_holed(position, 1.01 * escape * up)
    aside = np.array([1.01 * task.cup.radius, 0.0, 0.0])
    assert not task.is_holed(position + 0.06 * up, 0.0 * up), "above the rim"
    assert not task.is_holed(np.array([x, y, rim]), 0.0 * up), "level with the rim"
    assert not task.is_holed(position + aside, 0.0 * up), "outside the cup"


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_speed_in_any_direction_counts_as_energy_to_leave(task: Task, axis: int) -> None:
    """A ball that circles in the cup can leave it as well as one that flies up; for both signs of each axis."""
    x, y, rim = task.cup.position
    position, way = np.array([x, y, rim - 0.05]), np.eye(3)[axis]
    escape = np.sqrt(2.0 * 9.81 * (0.05 + task.world.ball_radius))
    for sign in (-1.0, 1.0):
        assert task.is_holed(position, sign * 0.99 * escape * way)
        assert not task.is_holed(position, sign * 1.01 * escape * way)
    edge = 0.99 * task.cup.radius * np.eye(3)[axis % 2]
    for sign in (-1.0, 1.0):
        assert task.is_holed(position + sign * edge, np.zeros(3))
        assert not task.is_holed(position + sign * edge * 1.02, np.zeros(3))


def test_spaces_contain_values_from_minus_one_to_one() -> None:
    """Two numbers for actions, one for each named feature for observations, float32."""
    for space, n in ((action_space(), 2), (state_space(), len(STATE_FEATURES))):
        assert space.shape == (n,) and space.dtype == np.float32
        for value, known in ((-1.0, True), (1.0, True), (-1.01, False), (1.01, False)):
            assert space.contains(np.full(n, value, np.float32)) is known


def test_noise_turns_and_scales_by_the_standard_deviations() -> None:
    """Noise of 1 turns by one deviation, counter-clockwise, or changes the speed by one; no putt runs backwards."""
    task = build_task(putt_noise=(3.0, 0.2))
    aims = np.array([[0.5, 0.0], [0.0, 0.4], [-0.3, -0.3], [0.6, -0.8]])
    aimed = task.launch_velocity(aims) @ np.array([1.0, 1.0j, 0.0])
    for draw, factor in (
        ((0.0, 0.0), 1.0),
        ((1.0, 0.0), np.exp(1j * np.radians(3.0))),
        ((-2.0, 0.0), np.exp(-1j * np.radians(6.0))),
        ((0.0, 1.0), 1.2),
        ((0.0, -2.0), 0.6),
        ((0.0, -9.0), 0.0),
    ):
        launched = task.launch_velocity(aims, np.tile(draw, (4, 1)))
        assert launched @ np.array([1.0, 1.0j, 0.0]) == pytest.approx(aimed * factor) and (launched[:, 2] == 0.0).all()
    assert task.is_noisy and build_task(putt_noise=(0.0, 0.1)).is_noisy and not build_task().is_noisy


def test_each_ball_draws_from_its_own_generator() -> None:
    """Noise and tees are those of the generators one by one; the tee's middle draws no number."""
    task = build_task()
    streams = [np.random.default_rng(seed) for seed in range(3)]
    drawn = [np.random.default_rng(seed).standard_normal(2) for seed in range(3)]
    assert np.array_equal(task.sample_noise(streams), drawn)
    lower, upper = np.array(task.course.tee.lower), np.array(task.course.tee.upper)
    starts = task.sample_start([np.random.default_rng(seed) for seed in range(3)])
    fractions = np.array([np.random.default_rng(seed).random(2) for seed in range(3)])
    assert starts[:, :2] == pytest.approx(lower + fractions * (upper - lower))
    assert starts[:, 2] == pytest.approx(task.course.tee.height + task.world.ball_radius)
    stream = np.random.default_rng(0)
    task.sample_start([stream])
    assert stream.random() == np.random.default_rng(0).random(3)[2], "two numbers are drawn, no more"
    middle = build_task(tee="fixed").sample_start([np.random.default_rng(0)])
    assert middle[0] == pytest.approx([*task.course.tee.centre, starts[0, 2]])


def test_state_observation_encodes_ball_cup_and_strokes_left() -> None:
    """Features are the position within the bounds, vectors in units of their diagonal, and the strokes left."""
    task = build_task(max_strokes=8)
    lower, upper = np.array(task.course.bounds)
    balls = np.random.default_rng(4).uniform(lower, upper, (50, 3))
    strokes = np.arange(50) % 9
    features = dict(zip(STATE_FEATURES, task.observe_state(balls, strokes).astype(np.float64).T, strict=True))
    scaled_balls = np.column_stack([features[f"ball {axis}"] for axis in "xyz"])
    assert lower + (scaled_balls + 1.0) / 2.0 * (upper - lower) == pytest.approx(balls, abs=1e-5)
    diagonal = np.hypot(*(upper - lower)[:2])
    to_cup = np.array(task.cup.position) - balls
    scaled_to_cup = np.column_stack([features[f"to cup {axis}"] for axis in "xyz"])
    assert scaled_to_cup * diagonal == pytest.approx(to_cup, abs=1e-5)
    distance = np.hypot(*to_cup[:, :2].T)
    root = features["root of cup distance"]
    assert root**2 * diagonal == pytest.approx(distance, abs=1e-5)
    straight = np.column_stack([features[f"straight putt {axis}"] for axis in "xy"])
    assert straight == pytest.approx(root[:, None] * to_cup[:, :2] / distance[:, None], abs=1e-6)
    assert features["strokes left"] == pytest.approx(1.0 - strokes / 8.0)
    beyond = task.observe_state(np.array([upper + 1.0, lower - 1.0, task.cup.position]), np.zeros(3, np.int64))
    assert (beyond[0, :3] == 1.0).all() and (beyond[1, :3] == -1.0).all() and (beyond[2, 3:9] == 0.0).all()


def test_distance_is_zero_at_the_cup_and_shrinks_along_the_route(task: Task) -> None:
    """Along the route the distance falls by the length covered; elsewhere it is at least the straight distance."""
    assert task.distance_to_cup(np.array(task.cup.position)) == pytest.approx(0.0)
    route = np.array(task.course.route)
    lengths = np.linalg.norm(np.diff(route, axis=0), axis=1)
    at_corners = task.distance_to_cup(np.column_stack([route, np.zeros(len(route))]))
    assert at_corners == pytest.approx([lengths[i:].sum() for i in range(len(route))])
    lower, upper = np.asarray(task.course.bounds)
    anywhere = np.random.default_rng(0).uniform(lower, upper, (1000, 3))
    straight = np.hypot(*(anywhere[:, :2] - np.array(task.cup.position)[:2]).T)
    assert (task.distance_to_cup(anywhere) >= straight - 1e-12).all()


@pytest.mark.parametrize("name", ["dogleg", "hill", "procedural-v1-hard-2"])
def test_distance_follows_the_nearest_route_segment(name: str) -> None:
    """The distance goes straight to the segment's end, then along the segments after it; shapely finds the nearest."""
    task = build_task(name)
    route = np.array(task.course.route)
    rng = np.random.default_rng(7)
    segments = [shapely.LineString(pair) for pair in itertools.pairwise(route)]
    lengths = [segment.length for segment in segments]
    points = route[rng.integers(len(route), size=300)] + rng.normal(0.0, 0.7, (300, 2))
    distances = task.distance_to_cup(np.column_stack([points, np.zeros(300)]))
    for point, distance in zip(points, distances, strict=True):
        offsets = np.array([segment.distance(shapely.Point(point)) for segment in segments])
        expected = [np.hypot(*(route[k + 1] - point)) + sum(lengths[k + 1 :]) for k in range(len(segments))]
        nearest = np.flatnonzero(offsets <= offsets.min() + 1e-9)
        assert min(abs(distance - expected[k]) for k in nearest) < 1e-9


def outcomes_at(positions: np.ndarray) -> Outcome:
    """Return outcomes of strokes that end at positions (N, 3)."""
    n = len(positions)
    return Outcome(positions, np.zeros(n, np.int8), np.zeros(n), np.zeros(n, np.int64))


def test_shaping_adds_a_constant_to_every_episode(task: Task) -> None:
    """Shaped rewards of an episode sum to minus the strokes minus the start's potential, whatever strokes it has."""
    rng = np.random.default_rng(1)
    start = task.sample_start([rng])[0]
    totals = []
    for strokes in (1, 2, 5):
        positions = np.array([start, *rng.uniform(0.1, 1.0, (strokes, 3))])
        ended = np.arange(1, strokes + 1) == strokes
        rewards = shaped_reward(positions[:-1], outcomes_at(positions[1:]), ended, task)
        totals.append(sum(rewards) + strokes)
    assert totals == pytest.approx([totals[0]] * 3)
    assert totals[0] == pytest.approx(-shaping_potential(task, start))


def test_shaped_reward_is_change_of_potential_less_one(task: Task) -> None:
    """The potential is minus one stroke and minus 0.3 for each metre to go, and 0 at the end of an episode."""
    balls = np.random.default_rng(5).uniform(*task.course.bounds, (20, 3))
    potential = shaping_potential(task, balls)
    assert potential == pytest.approx(-1.0 - 0.3 * task.distance_to_cup(balls))
    assert shaping_potential(task, balls.reshape(4, 5, 3)).shape == (4, 5)
    outcome = outcomes_at(balls[10:])
    playing = shaped_reward(balls[:10], outcome, np.zeros(10, np.bool_), task)
    assert playing == pytest.approx(-1.0 + potential[10:] - potential[:10])
    ended = shaped_reward(balls[:10], outcome, np.ones(10, np.bool_), task)
    assert ended == pytest.approx(-1.0 - potential[:10])


def test_strokes_reward_is_minus_one_a_stroke(task: Task) -> None:
    """The reward is -1 wherever the ball comes to rest, and whether the episode ends or not."""
    balls = np.random.default_rng(5).uniform(*task.course.bounds, (20, 3))
    ended = np.arange(10) % 2 == 0
    assert strokes_reward(balls[:10], outcomes_at(balls[10:]), ended, task).tolist() == [-1.0] * 10


def test_simulated_path_is_that_of_the_stroke(task: Task) -> None:
    """The path starts where the ball is struck, and ends where and when the stroke does."""
    start = task.sample_start([np.random.default_rng(6)])
    putt, outcome, _ = task.play(start, np.array([[0.4, 0.1]]))
    path, times = task.simulate_path(start[0], putt[0])
    assert path[0] == pytest.approx(start[0]) and path[-1] == pytest.approx(outcome.position[0])
    assert times[0] == 0.0 and times[-1] == pytest.approx(outcome.time[0]) and (np.diff(times) >= 0.0).all()
    assert outcome.result[0] == Result.REST and outcome.bounces[0] > 0 and not outcome.holed[0]


def test_reshaped_outcome_keeps_its_strokes() -> None:
    """Each row of the new shape has the strokes that numpy's reshape gives it."""
    outcome = Outcome(np.arange(18.0).reshape(6, 3), np.arange(6, dtype=np.int8), np.arange(6.0), np.arange(6))
    square = outcome.reshape(2, 3)
    assert square.position.shape == (2, 3, 3) and square.holed.tolist() == [[False] * 3, [True, False, False]]
    for k in range(6):
        row, column = divmod(k, 3)
        assert (square.position[row, column] == [3 * k, 3 * k + 1, 3 * k + 2]).all()
        assert square.result[row, column] == square.time[row, column] == square.bounces[row, column] == k


def test_stacked_tasks_play_each_on_its_own_hole() -> None:
    """Ball i starts, putts and moves as task i does; rows select among them. One task alone stays itself."""
    tasks = [build_task(name, max_strokes=5, putt_noise=(1.0, 0.1), tee="fixed") for name in ("dogleg", "hill")]
    assert stack_tasks(tasks[:1]) is stack_tasks([tasks[0]] * 3) is tasks[0]
    assert tasks[0].take(np.array([0, 0])) is tasks[0]
    for rows in ([0, 1], [1, 0, 1]):
        game = stack_tasks(tasks).take(np.array(rows))
        mine = [tasks[i] for i in rows]
        assert game.tasks == tuple(mine) and game.max_strokes == 5 and game.is_noisy
        starts = game.sample_start([np.random.default_rng(0)] * len(rows))
        aims = np.tile([0.3, 0.1], (len(rows), 1))
        draws = np.full((len(rows), 2), 0.5)
        strokes = np.arange(len(rows))
        played = game.play(starts, aims, strokes, draws)
        assert (game.launch_velocity(aims, draws) == played.velocity).all()
        for i, task in enumerate(mine):
            assert (starts[i] == task.sample_start([np.random.default_rng(0)])[0]).all()
            assert (played.velocity[i] == task.launch_velocity(aims[i], draws[i])).all()
            one = slice(i, i + 1)
            alone = task.play(starts[one], aims[one], strokes[one], draws[one])
            fields = zip((*played.outcome, played.state), (*alone.outcome, alone.state), strict=True)
            assert all(many[i].tobytes() == single[0].tobytes() for many, single in fields)
            assert (played.state[one] == task.observe_state(alone.outcome.position, strokes[one] + 1)).all()
            assert game.distance_to_cup(starts)[i] == task.distance_to_cup(starts[i])
            assert shaping_potential(game, starts)[i] == shaping_potential(task, starts[i])


def test_rules_give_same_bits_for_one_ball_and_many(task: Task) -> None:
    """Arrays of any leading shape give the bits of single balls."""
    rng = np.random.default_rng(2)
    positions, putts = rng.uniform(0.1, 1.0, (5, 3)), rng.uniform(-1, 1, (5, 2))
    strokes = np.arange(5)
    observed = [task.observe_state(positions[i : i + 1], strokes[i : i + 1])[0] for i in range(5)]
    for many, one in (
        (task.launch_velocity(putts), [task.launch_velocity(p) for p in putts]),
        (task.observe_state(positions, strokes), observed),
        (task.distance_to_cup(positions), [task.distance_to_cup(p) for p in positions]),
        (task.is_holed(positions, positions), [task.is_holed(p, p) for p in positions]),
    ):
        assert many.tobytes() == np.array(one).tobytes()


def test_ball_out_of_bounds_is_put_back(task: Task) -> None:
    """A ball out of bounds is put back where it was struck."""
    lower, upper = np.asarray(task.course.bounds)
    start = np.array([[upper[0] - 0.01, 0.5 * (lower[1] + upper[1]), upper[2] - 0.01]])
    outcome = task.play(start, np.array([[1.0, 0.0]])).outcome
    assert outcome.result[0] == Result.OUT_OF_BOUNDS
    assert (outcome.position == start).all()
