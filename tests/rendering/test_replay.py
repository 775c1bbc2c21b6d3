"""A putt as a film: the ball is where the physics had it and rolls without slipping; the camera does not jump."""

from __future__ import annotations

import numpy as np
import pytest

from minigolf_env.courses import load_course
from minigolf_env.rendering.replay import (
    FLAG_LIFT_HEIGHT,
    PAUSE_AFTER_PUTT,
    FloatArray,
    Replay,
    flag_position,
    static_view,
)

DOGLEG = load_course("dogleg")
WORLD = DOGLEG.world()
TEE = np.array([0.35, 0.625, DOGLEG.ball_radius])


def replay(camera: str = "follow", speed: float = 3.0, turn: float = 0.3, **options: object) -> Replay:
    """Return a putt from the dogleg's tee: speed in m/s, turn from the x axis in radians."""
    velocity = speed * np.array([np.cos(turn), np.sin(turn), 0.0])
    shot = WORLD.simulate(TEE, velocity, record=True)
    assert shot.path is not None and shot.times is not None
    return Replay(DOGLEG, shot.path, shot.times, camera, 4 / 3, **options)  # type: ignore[arg-type]


def test_the_ball_is_where_the_physics_had_it() -> None:
    """At every recorded time, at the start and after the end."""
    shot = WORLD.simulate(TEE, (2.0, 0.5, 0.0), record=True)
    assert shot.path is not None and shot.times is not None
    film = Replay(DOGLEG, shot.path, shot.times, "top", 1.0)
    for position, time in zip(shot.path, shot.times, strict=True):
        np.testing.assert_allclose(film.scene_state(time).ball, position, atol=1e-12)
    np.testing.assert_array_equal(film.scene_state(shot.time + 1.0).ball, shot.position)
    assert film.duration == shot.time + PAUSE_AFTER_PUTT


def test_the_ball_rolls_without_slipping() -> None:
    """Along a straight way its lowest point rests on the ground, and a whole circumference is a whole turn."""
    radius = DOGLEG.ball_radius
    x = np.linspace(0.0, 2.0 * np.pi * radius, 101)
    path = np.stack([0.5 + x, np.full(101, 0.6), np.full(101, radius)], axis=-1)
    film = Replay(DOGLEG, path, np.linspace(0.0, 1.0, 101), "top", 1.0)
    quarter = film.scene_state(0.25).rotation
    np.testing.assert_allclose(quarter @ [0, 0, 1], [1, 0, 0], atol=1e-9)  # Its top has come to the front.
    np.testing.assert_allclose(film.scene_state(1.0).rotation, np.eye(3), atol=1e-9)


def test_turns_are_rotations_and_go_on() -> None:
    """However long the way; and the next putt starts with the last one's turn."""
    first = replay()
    turn = first.final_rotation
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(turn) > 0.0
    resting = np.tile(TEE, (2, 1)), np.array([0.0, 1.0])
    np.testing.assert_array_equal(Replay(DOGLEG, *resting, "top", 1.0, rotation=turn).scene_state(0.0).rotation, turn)


def test_the_flag_is_out_of_the_way_when_the_ball_comes() -> None:
    """Down while the ball is far, lifted above the cup, and moving evenly in between."""
    assert DOGLEG.cup is not None
    x, y, rim = DOGLEG.cup.position
    bottom = rim - DOGLEG.cup.depth
    balls = [np.array([x - distance, y, 0.02]) for distance in np.linspace(2, 0, 200)]
    lifts = np.array([flag_position(DOGLEG, ball)[2] - bottom for ball in balls])
    assert lifts[0] == 0.0 and lifts[-1] == pytest.approx(FLAG_LIFT_HEIGHT)
    assert (np.diff(lifts) >= 0.0).all() and np.diff(lifts).max() < 0.02


@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_a_following_camera_is_smooth(speed: float) -> None:
    """From picture to picture it goes no further than the ball may, and changes its way gently; also into the next."""
    first = replay(speed=speed)
    end = first.scene_state(first.shot_time).ball
    resting = np.tile(end, (30, 1)), np.arange(30) / 120
    second = Replay(DOGLEG, *resting, "follow", 4 / 3, previous_camera=first.final_camera)
    eyes = [film.camera(time).eye for film in (first, second) for time in film.frame_times(60)]
    steps = np.diff(eyes, axis=0) * 60.0
    assert np.linalg.norm(steps, axis=1).max() < 1.5 * speed + 3.0
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).max() < 0.15 * (1.5 * speed + 3.0)


def test_pictures_are_counted_and_the_trail_fades() -> None:
    """One picture each 1 / fps of the duration; a trail behind a moving ball, none before and none in the end."""
    film = replay()
    assert len(film.frame_times(30)) == int(np.ceil(film.duration * 30))
    assert not film.scene_state(0.0).lines and film.scene_state(0.5).lines and not film.scene_state(film.duration).lines
    ends: FloatArray = film.scene_state(0.5).lines[0].points[-1]
    np.testing.assert_allclose(ends[:2], film.scene_state(0.5).ball[:2], atol=1e-9)


def test_a_band_keeps_its_width() -> None:
    """The two borders of a straight trail are parallel and as far apart as it is wide."""
    line = replay().path_line(50)
    band, tints = line.triangle_strip()
    across = np.linalg.norm(band[1::2] - band[::2], axis=1)
    np.testing.assert_allclose(across, line.width, rtol=1e-9)
    assert tints.shape == (100, 4) and tints.min() >= 0.0 and tints.max() <= 1.0


def test_a_still_picture_shows_the_ball_at_rest() -> None:
    """With the flag in the cup when it is far."""
    _, state = static_view(DOGLEG, "tee", 1.0, TEE)
    np.testing.assert_array_equal(state.ball, TEE)
    assert DOGLEG.cup is not None and state.flag[2] == -DOGLEG.cup.depth and not state.lines
