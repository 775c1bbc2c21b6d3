"""Every bundled hole: closed, small to load, solvable, and without traps."""

from __future__ import annotations

import functools

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

import minigolf_env  # noqa: F401 (registers the environment)
from minigolf_env.courses import Course, list_courses, load_course
from minigolf_env.courses.io.toml_course import read_description
from minigolf_env.courses.library import DATA_DIR
from minigolf_env.courses.schema.course_file import CourseFile
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.task import Result
from minigolf_env.physics import Status, World

HOLE_NAMES = list_courses()
LARGE_HOLE = "green100k"
FloatArray = NDArray[np.float64]


@functools.cache
def world_of(name: str) -> World:
    """Return a hole's world from a cache."""
    return load_course(name).world()


def description(name: str) -> CourseFile:
    """Return the description in a hole's file."""
    return read_description(DATA_DIR / f"{name}.toml")


def sample_tee(course: Course, n: int, rng: np.random.Generator) -> FloatArray:
    """Return n random starts (n, 3) from the tee."""
    lower, upper = np.array(course.tee.lower), np.array(course.tee.upper)
    level = np.full(n, course.tee.height + course.ball_radius)
    return np.column_stack([lower + rng.random((n, 2)) * (upper - lower), level])


def putts(n: int, fastest: float, rng: np.random.Generator) -> FloatArray:
    """Return random horizontal velocities (n, 3)."""
    angle, speed = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.0, fastest, n)
    return np.column_stack([speed * np.cos(angle), speed * np.sin(angle), np.zeros(n)])


@pytest.mark.parametrize("name", HOLE_NAMES)
def test_hole_file_is_small_and_has_par_and_hole_in_one(name: str) -> None:
    """A hole's file has a description and is smaller than 4 kB."""
    file = description(name)
    assert file.name == name and file.about and file.par is not None and file.hole_in_one is not None
    assert (DATA_DIR / f"{name}.toml").stat().st_size < 4000
    assert {part.kind for part in file.parts} - {"mesh"}


@pytest.mark.parametrize("name", HOLE_NAMES)
def test_known_hole_in_one_holes_out_single_and_in_batch(name: str) -> None:
    """The file's action holes out from the middle of the tee, in one environment and in a batch."""
    action = np.array(description(name).hole_in_one, dtype=np.float32)
    env = gym.make("MiniGolf-v0", course=name, tee="fixed", reward="strokes")
    env.reset(seed=0)
    _, reward, terminated, _, info = env.step(action)
    assert info["is_success"] and terminated and reward == -1.0 and info["course"] == name
    envs = gym.make_vec("MiniGolf-v0", num_envs=3, course=name, tee="fixed")
    envs.reset(seed=0)
    _, _, terminated, _, infos = envs.step(np.stack([action, 0.0 * action, action]))
    assert infos["is_success"].tolist() == [True, False, True] and terminated.tolist() == [True, False, True]


@pytest.mark.parametrize("name", HOLE_NAMES)
def test_random_putts_end_in_play_in_cup_or_out_of_bounds(name: str) -> None:
    """From the tee and from where such putts end, no ball sinks, gets stuck, escapes or exhausts its sub-steps."""
    course, world, rng = load_course(name), world_of(name), np.random.default_rng(1)
    n = 120 if name == LARGE_HOLE else 400
    starts = sample_tee(course, n, rng)
    for _ in range(2):
        shots = world.simulate_batch(starts, putts(len(starts), course.top_speed, rng))
        assert not np.any(shots.exhausted)
        assert world.clearance(shots.position).min() >= -1e-12 * world.coordinate_scale
        is_out = np.isin(shots.status, [Status.OUT_OF_BOUNDS])
        if name not in ("gap", "islands", "halfpipe"):  # Over water, and over the lips of the pipe.
            assert not is_out.any()
        is_timed_out = np.asarray(shots.status) == Status.TIME_LIMIT
        # Balls roll slowly for a long time where the slope equals rolling resistance.
        assert is_timed_out.mean() <= (0.01 if name == LARGE_HOLE else 0.0)
        assert (shots.position[~is_out] >= course.bounds[0]).all()
        starts = shots.position[np.asarray(shots.status) == Status.REST]


@pytest.mark.parametrize("name", [name for name in HOLE_NAMES if name != LARGE_HOLE])
def test_every_resting_position_is_playable(name: str) -> None:
    """From where random putts end, some other putt leads well away, off the course or into the cup."""
    rng = np.random.default_rng(2)
    env = MiniGolfEnv(course=name)
    env.reset(seed=0)
    actions = putts(400, 1.0, rng)[:, :2]
    first = env.what_if(actions)
    positions = first.position[(first.result == Result.REST)][:30]
    world, task = env.task.world, env.task
    escapes = putts(24, 1.0, rng)[:, :2]
    starts = np.repeat(positions, len(escapes), axis=0)
    second = task.play(starts, np.tile(escapes, (len(positions), 1))).outcome
    distance = np.linalg.norm(second.position - starts, axis=1).reshape(len(positions), -1)
    has_left = np.isin(second.result, [Result.HOLED, Result.OUT_OF_BOUNDS]).reshape(len(positions), -1)
    assert len(positions) == 30 and ((distance > 10.0 * world.ball_radius) | has_left).any(axis=1).all()


@pytest.mark.parametrize("name", HOLE_NAMES)
def test_only_green100k_has_over_100000_triangles(name: str) -> None:
    """All holes but green100k have fewer triangles."""
    count = sum(len(part.mesh.faces) for part in load_course(name).parts)
    assert (count > 100_000) == (name == LARGE_HOLE)


@pytest.mark.parametrize("name", HOLE_NAMES)
def test_every_hole_passes_gymnasium_env_checker(name: str) -> None:
    """Gymnasium's check_env accepts an environment on each hole."""
    check_env(gym.make("MiniGolf-v0", course=name).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("fraction", [0.6, 0.7, 0.85, 1.0])
def test_loop_passes_straight_putts_from_two_thirds_of_top_speed(fraction: float) -> None:
    """Fast straight putts pass over the top and come out behind the loop; slow putts fall back."""
    course, world = load_course("loop"), world_of("loop")
    x, y = course.tee.centre
    start = (x, y, course.ball_radius)
    shot = world.simulate(start, (fraction * course.top_speed, 0.0, 0.0), record=True)
    assert shot.path[:, 2].max() > 0.55 and shot.path[:, 0].max() > 3.0
    slow = world.simulate(start, (0.3 * course.top_speed, 0.0, 0.0), record=True)
    assert slow.path[:, 2].max() < 0.3 and slow.position[0] < 2.2


@pytest.mark.parametrize("sides", [64, 256])
def test_loop_facets_keep_cosine_of_their_angle_of_speed(sides: int) -> None:
    """With an angle of 1.4 degrees all facets together take less than a tenth."""
    from minigolf_env.courses.geometry.solids import build_loop_track
    from minigolf_env.physics import Surface, TriangleMesh

    solid = build_loop_track(0.3, 0.4, 0.5, 0.06, 0.03, sides)
    mesh = TriangleMesh(solid.vertices, solid.faces, Surface(restitution=0.0, tangential=1.0, rolling=0.0))
    world = World([mesh], gravity=(0.0, 0.0, 0.0))
    shot = world.simulate((0.001, 0.0, 0.0224), (2.0, 0.0, 0.0), max_time=0.8, record=True)
    kept = float(np.linalg.norm(shot.velocity)) / 2.0
    fraction = np.cos(2.0 * np.pi / sides) ** sides
    assert shot.path[:, 2].max() > 0.55
    assert fraction - 0.06 < kept <= fraction + 0.08
