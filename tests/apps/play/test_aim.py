"""Tests of aiming with the mouse and with keys."""

import math

import numpy as np
import pytest

from minigolf_env.apps.play.aim import FULL_POWER_DRAG_LENGTH, MIN_DRAG_LENGTH, Aim, aim_along_view, aim_from_drag
from minigolf_env.courses import load_course
from minigolf_env.rendering import Camera
from minigolf_env.rendering.camera import follow_camera

SIZE = 960, 600
BALL = np.array([0.35, 0.625, 0.02135])


def player_camera() -> Camera:
    """Return the player's camera on the dogleg."""
    return follow_camera(load_course("dogleg"), BALL, SIZE[0] / SIZE[1])


def to_pixel(position: np.ndarray) -> np.ndarray:
    """Return the pixel of a position (3,) in the window, y up."""
    x, y, _, w = player_camera().clip_from_world(SIZE[0] / SIZE[1]) @ np.append(position, 1.0)
    return np.array([(x / w + 1.0) * SIZE[0] / 2.0, (y / w + 1.0) * SIZE[1] / 2.0])


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_putt_points_away_from_the_drag_on_the_screen(degrees: int) -> None:
    """On the screen the putt is opposite to the drag, whatever the perspective."""
    drag = 150.0 * np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    aim = aim_from_drag(player_camera(), BALL, (drag[0], drag[1]), SIZE)
    assert aim is not None
    on_screen = to_pixel(BALL + 1e-4 * aim.direction) - to_pixel(BALL)
    assert on_screen @ drag / np.linalg.norm(on_screen) / np.linalg.norm(drag) == pytest.approx(-1.0, abs=1e-4)


def test_power_grows_with_the_drag_length_up_to_one() -> None:
    """A longer drag gives more power, up to 1; a drag below the minimum gives no aim."""
    lengths = (0.1, 0.2, FULL_POWER_DRAG_LENGTH, 0.9)
    aims = [aim_from_drag(player_camera(), BALL, (0.0, -length * SIZE[1]), SIZE) for length in lengths]
    assert aims[0] and aims[1] and aims[2] and aims[3]
    assert aims[0].power < aims[1].power < aims[2].power
    assert aims[2].power == pytest.approx(1.0) == aims[3].power
    assert aim_from_drag(player_camera(), BALL, (0.0, -0.9 * MIN_DRAG_LENGTH * SIZE[1]), SIZE) is None


def test_ball_behind_the_camera_is_aimed_along_the_line_of_sight() -> None:
    """The projection of a ball behind the camera has no direction on the screen."""
    camera = Camera((1.0, 0.0, 0.5), (2.0, 0.0, 0.5))
    aim = aim_from_drag(camera, np.zeros(3), (0.0, -100.0), SIZE)
    assert aim is not None
    assert aim.direction == pytest.approx((1.0, 0.0, 0.0))


def test_turning_keeps_power_and_more_power_keeps_direction() -> None:
    """Power stays between its bounds when it changes, and turns keep it."""
    aim = aim_along_view(player_camera(), 0.5)
    assert aim.turned(90.0).power == pytest.approx(0.5)
    assert aim.turned(90.0).direction @ aim.direction == pytest.approx(0.0, abs=1e-12)
    assert aim.stronger(0.2).power == pytest.approx(0.7)
    assert aim.stronger(0.2).direction == pytest.approx(aim.direction)
    assert aim.stronger(9.0).power == pytest.approx(1.0)
    assert 0.0 < aim.stronger(-9.0).power < 0.05


def test_elevation_raises_the_direction_and_keeps_its_heading() -> None:
    """The direction is a unit vector at the elevation above the putt vector."""
    assert Aim(0.0, 0.4, elevation=30.0).direction == pytest.approx((0.0, math.sqrt(0.75), 0.5))
