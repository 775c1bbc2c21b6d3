"""Cameras: everything that a camera promises to show is in its image."""

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


def project(camera: Camera, points: FloatArray, aspect: float) -> FloatArray:
    """Return the positions of points (N, 3) in the image (N, 3): x and y in [-1, 1], depth in [-1, 1]."""
    clip = np.append(points, np.ones((len(points), 1)), axis=1) @ camera.clip_from_world(aspect).T
    assert (clip[:, 3] > 0.0).all()
    return np.asarray(clip[:, :3] / clip[:, 3:])


@pytest.mark.parametrize("aspect", ASPECTS)
@pytest.mark.parametrize("name", ["top", "tee", "orbit"])
@pytest.mark.parametrize("course", COURSES)
def test_fitted_camera_shows_the_whole_course_and_no_more_than_needed(course: str, name: str, aspect: float) -> None:
    """The course with its flag touches the margin on the left and right, or at the top and bottom."""
    golf = load_course(course)
    camera = make_camera(name, golf, np.zeros(3), aspect)
    points = [part.mesh.vertices for part in golf.parts]
    if golf.cup is not None:
        points.append(np.add(golf.cup.position, [(0.0, 0.0, POLE_HEIGHT)]))
    projected = project(camera, np.concatenate(points), aspect)
    assert np.abs(projected).max() <= 1.0
    edges = np.array([projected[:, :2].max(axis=0), -projected[:, :2].min(axis=0)]) * FIT_MARGIN
    assert np.isclose(edges, 1.0, atol=1e-9).all(axis=0).any()


def test_top_camera_has_x_to_the_right_and_y_up() -> None:
    """The top camera shows x to the right and y up, as in an action."""
    camera = make_camera("top", DOGLEG, np.zeros(3), 1.0)
    origin, x, y = project(camera, np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), 1.0)
    assert x[0] > origin[0] + 0.1 and y[1] > origin[1] + 0.1
    np.testing.assert_allclose([x[1], y[0]], [origin[1], origin[0]], atol=1e-12)


def test_follow_camera_has_the_ball_in_the_middle_third() -> None:
    """The ball is in the lower half, with the course ahead of it above, for positions all over the lane."""
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((0.05, 0.05), (2.7, 1.2), (200, 2)):
        ball = project(follow_camera(DOGLEG, (x, y, 0.02), 4 / 3), np.array([[x, y, 0.02]]), 4 / 3)[0]
        assert abs(ball[0]) < 0.33 and -0.8 < ball[1] < 0.2


def test_follow_camera_looks_along_the_route() -> None:
    """The camera looks along x on the first segment and along y on the second, also next to the cup."""
    for ball, ahead in [((0.4, 0.6), (1, 0)), ((3.4, 1.3), (0, 1)), ((3.45, 2.05), (0, 1)), ((3.45, 2.2), (0, 1))]:
        forward = follow_camera(DOGLEG, (*ball, 0.02), 1.0).axes()[2][:2]
        assert forward @ ahead > 0.8 * np.linalg.norm(forward)


def test_ray_is_the_inverse_of_the_projection() -> None:
    """Points along the ray of a place in the image are projected to that place."""
    rng = np.random.default_rng(1)
    for name in CAMERA_NAMES:
        camera = make_camera(name, DOGLEG, np.array([0.4, 0.6, 0.02]), 1.5, time=2.0)
        for x, y in rng.uniform(-1, 1, (20, 2)):
            start, direction = camera.ray(x, y, 1.5)
            projected = project(camera, np.array([start + 0.5 * direction, start + 7.0 * direction]), 1.5)
            np.testing.assert_allclose(projected[:, :2], [[x, y]] * 2, atol=1e-9)


def test_axes_are_orthonormal_and_right_handed() -> None:
    """The axes right, up and backwards form a rotation matrix for every camera."""
    for name in CAMERA_NAMES:
        right, up, forward = make_camera(name, DOGLEG, np.array([1.0, 0.3, 0.02]), 1.0).axes()
        axes = np.stack([right, up, -forward])
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) > 0.0


def test_orbit_camera_returns_after_a_whole_turn() -> None:
    """The orbit camera makes a whole turn in 30 s."""
    ball = np.zeros(3)
    first, later, full_turn = (make_camera("orbit", DOGLEG, ball, 1.0, time) for time in (0.0, 7.5, 30.0))
    assert np.linalg.norm(np.subtract(first.eye, later.eye)) > 1.0
    np.testing.assert_allclose(first.eye, full_turn.eye, atol=1e-9)


def test_cameras_compare_and_hash_by_value() -> None:
    """Equal cameras have equal hashes, so that they are keys of the cached backgrounds."""
    camera = make_camera("tee", DOGLEG, np.zeros(3), 1.0)
    assert camera == dataclasses.replace(camera) and hash(camera) == hash(dataclasses.replace(camera))
