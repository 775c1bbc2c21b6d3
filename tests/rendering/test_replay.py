"""Replays of putts: the ball follows the physics and rolls without slipping; the camera does not jump."""

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


def make_replay(camera: str = "follow", speed: float = 3.0, angle: float = 0.3, **options: object) -> Replay:
    """Return the replay of a putt from the dogleg's tee: speed in m/s, angle from the x axis in radians."""
    velocity = speed * np.array([np.cos(angle), np.sin(angle), 0.0])
    shot = WORLD.simulate(TEE, velocity, record=True)
    assert shot.path is not None and shot.times is not None
    return Replay(DOGLEG, shot.path, shot.times, camera, 4 / 3, **options)  # type: ignore[arg-type]


def test_ball_is_at_the_simulated_position() -> None:
    """The ball is on the simulated path at every recorded time, at the start, and after the end."""
    shot = WORLD.simulate(TEE, (2.0, 0.5, 0.0), record=True)
    assert shot.path is not None and shot.times is not None
    replay = Replay(DOGLEG, shot.path, shot.times, "top", 1.0)
    for position, time in zip(shot.path, shot.times, strict=True):
        np.testing.assert_allclose(replay.scene_state(time).ball, position, atol=1e-12)
    np.testing.assert_array_equal(replay.scene_state(shot.time + 1.0).ball, shot.position)
    assert replay.duration == shot.time + PAUSE_AFTER_PUTT


def test_ball_rolls_without_slipping() -> None:
    """After a quarter of its circumference its top is in front, after all of it the rotation is complete."""
    radius = DOGLEG.ball_radius
    x = np.linspace(0.0, 2.0 * np.pi * radius, 101)
    path = np.stack([0.5 + x, np.full(101, 0.6), np.full(101, radius)], axis=-1)
    replay = Replay(DOGLEG, path, np.linspace(0.0, 1.0, 101), "top", 1.0)
    quarter = replay.scene_state(0.25).rotation
    np.testing.assert_allclose(quarter @ [0, 0, 1], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(replay.scene_state(1.0).rotation, np.eye(3), atol=1e-9)


def test_rotation_stays_orthogonal_and_continues_with_the_next_putt() -> None:
    """The final matrix of a long putt is a rotation, and the initial one of the next."""
    rotation = make_replay().final_rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) > 0.0
    resting = np.tile(TEE, (2, 1)), np.array([0.0, 1.0])
    following = Replay(DOGLEG, *resting, "top", 1.0, rotation=rotation)
    np.testing.assert_array_equal(following.scene_state(0.0).rotation, rotation)


def test_flag_is_lifted_when_the_ball_approaches_the_cup() -> None:
    """The flag stands in the cup while the ball is far, is lifted above the cup, and moves smoothly in between."""
    assert DOGLEG.cup is not None
    x, y, rim = DOGLEG.cup.position
    bottom = rim - DOGLEG.cup.depth
    balls = [np.array([x - distance, y, 0.02]) for distance in np.linspace(2, 0, 200)]
    lifts = np.array([flag_position(DOGLEG, ball)[2] - bottom for ball in balls])
    assert lifts[0] == 0.0 and lifts[-1] == pytest.approx(FLAG_LIFT_HEIGHT)
    assert (np.diff(lifts) >= 0.0).all() and np.diff(lifts).max() < 0.02


@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_follow_camera_moves_smoothly(speed: float) -> None:
    """Velocity and acceleration of the follow camera are bounded, also from one putt to the next."""
    first = make_replay(speed=speed)
    end = first.scene_state(first.shot_time).ball
    resting = np.tile(end, (30, 1)), np.arange(30) / 120
    second = Replay(DOGLEG, *resting, "follow", 4 / 3, previous_camera=first.final_camera)
    eyes = [replay.camera(time).eye for replay in (first, second) for time in replay.frame_times(60)]
    velocities = np.diff(eyes, axis=0) * 60.0
    assert np.linalg.norm(velocities, axis=1).max() < 1.5 * speed + 3.0
    assert np.linalg.norm(np.diff(velocities, axis=0), axis=1).max() < 0.15 * (1.5 * speed + 3.0)


def test_frames_cover_the_duration_and_the_trail_fades() -> None:
    """There is a frame each 1 / fps; the trail ends at the moving ball, and there is none at the start and the end."""
    replay = make_replay()
    assert len(replay.frame_times(30)) == int(np.ceil(replay.duration * 30))
    assert not replay.scene_state(0.0).lines and not replay.scene_state(replay.duration).lines
    state = replay.scene_state(0.5)
    trail_end: FloatArray = state.lines[0].points[-1]
    np.testing.assert_allclose(trail_end[:2], state.ball[:2], atol=1e-9)


def test_triangle_strip_of_a_line_has_its_width() -> None:
    """The borders of the strip are as far apart as the line is wide; its colours are in [0, 1]."""
    line = make_replay().path_line(50)
    positions, colors = line.triangle_strip()
    widths = np.linalg.norm(positions[1::2] - positions[::2], axis=1)
    np.testing.assert_allclose(widths, line.width, rtol=1e-9)
    assert colors.shape == (100, 4) and colors.min() >= 0.0 and colors.max() <= 1.0


def test_static_view_has_the_ball_at_rest_and_the_flag_in_a_distant_cup() -> None:
    """The static view has the ball at rest, the flag in the cup, and no trail."""
    _, state = static_view(DOGLEG, "tee", 1.0, TEE)
    np.testing.assert_array_equal(state.ball, TEE)
    assert DOGLEG.cup is not None and state.flag[2] == -DOGLEG.cup.depth and not state.lines
