"""Cameras: what a view promises to show is in its picture."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from minigolf_env.courses import load_course
from minigolf_env.rendering.camera import CAMERA_NAMES, FIT_MARGIN, Camera, FloatArray, follow_camera, make_camera
from minigolf_env.rendering.props import POLE_HEIGHT

ASPECTS = (0.1, 0.6, 1.0, 16 / 9)
COURSES = ("dogleg", "room")
DOGLEG = load_course("dogleg")


def seen(camera: Camera, points: FloatArray, aspect: float) -> FloatArray:
    """Return where points (N, 3) are in the picture (N, 3): x and y in [-1, 1], depth in [-1, 1]."""
    at = np.append(points, np.ones((len(points), 1)), axis=1) @ camera.clip_from_world(aspect).T
    assert (at[:, 3] > 0.0).all()
    return np.asarray(at[:, :3] / at[:, 3:])


@pytest.mark.parametrize("aspect", ASPECTS)
@pytest.mark.parametrize("name", ["top", "tee", "orbit"])
@pytest.mark.parametrize("course", COURSES)
def test_a_fitted_view_shows_the_whole_course_and_no_more_than_needed(course: str, name: str, aspect: float) -> None:
    """All is in the picture, the flag too, and it goes to the margin on both sides, or above and below."""
    golf = load_course(course)
    camera = make_camera(name, golf, np.zeros(3), aspect)
    points = [part.mesh.vertices for part in golf.parts]
    if golf.cup is not None:
        points.append(np.add(golf.cup.position, [(0.0, 0.0, POLE_HEIGHT)]))
    at = seen(camera, np.concatenate(points), aspect)
    assert np.abs(at).max() <= 1.0
    edges = np.array([at[:, :2].max(axis=0), -at[:, :2].min(axis=0)]) * FIT_MARGIN
    assert np.isclose(edges, 1.0, atol=1e-9).all(axis=0).any()


def test_seen_from_above_x_goes_right_and_y_up() -> None:
    """An action points in the picture as it does on the course."""
    camera = make_camera("top", DOGLEG, np.zeros(3), 1.0)
    origin, x, y = seen(camera, np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), 1.0)
    assert x[0] > origin[0] + 0.1 and y[1] > origin[1] + 0.1
    np.testing.assert_allclose([x[1], y[0]], [origin[1], origin[0]], atol=1e-12)


def test_behind_the_ball_one_sees_the_ball() -> None:
    """From every lie on the lane the ball is in the middle third of the picture, and ahead of it lies the course."""
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((0.05, 0.05), (2.7, 1.2), (200, 2)):
        at = seen(follow_camera(DOGLEG, (x, y, 0.02), 4 / 3), np.array([[x, y, 0.02]]), 4 / 3)[0]
        assert abs(at[0]) < 0.33 and -0.8 < at[1] < 0.2


def test_behind_the_ball_one_looks_where_the_course_goes() -> None:
    """On the first leg along x, on the second along y; next to the cup still along the last leg."""
    for ball, ahead in [((0.4, 0.6), (1, 0)), ((3.4, 1.3), (0, 1)), ((3.45, 2.05), (0, 1)), ((3.45, 2.2), (0, 1))]:
        forward = follow_camera(DOGLEG, (*ball, 0.02), 1.0).axes()[2][:2]
        assert forward @ ahead > 0.8 * np.linalg.norm(forward)


def test_a_ray_leads_to_where_its_point_is_seen() -> None:
    """Points along the ray through a place of the picture are seen at that place."""
    rng = np.random.default_rng(1)
    for name in CAMERA_NAMES:
        camera = make_camera(name, DOGLEG, np.array([0.4, 0.6, 0.02]), 1.5, time=2.0)
        for x, y in rng.uniform(-1, 1, (20, 2)):
            start, way = camera.ray(x, y, 1.5)
            at = seen(camera, np.array([start + 0.5 * way, start + 7.0 * way]), 1.5)
            np.testing.assert_allclose(at[:, :2], [[x, y]] * 2, atol=1e-9)


def test_axes_are_a_right_handed_frame() -> None:
    """Right, up and backwards are orthonormal and right-handed, whatever the camera."""
    for name in CAMERA_NAMES:
        right, up, forward = make_camera(name, DOGLEG, np.array([1.0, 0.3, 0.02]), 1.0).axes()
        frame = np.stack([right, up, -forward])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) > 0.0


def test_the_orbit_goes_round() -> None:
    """It turns with the time shown, keeps its height roughly, and comes back after a whole turn."""
    ball = np.zeros(3)
    first, later, again = (make_camera("orbit", DOGLEG, ball, 1.0, time) for time in (0.0, 7.5, 30.0))
    assert np.linalg.norm(np.subtract(first.eye, later.eye)) > 1.0
    np.testing.assert_allclose(first.eye, again.eye, atol=1e-9)


def test_cameras_are_plain_values() -> None:
    """They compare and hash by value, so that a still is found again."""
    camera = make_camera("tee", DOGLEG, np.zeros(3), 1.0)
    assert camera == dataclasses.replace(camera) and hash(camera) == hash(dataclasses.replace(camera))
