"""Aiming: what a drag of the mouse, and the keys, mean."""

import math

import numpy as np
import pytest

from minigolf_env.apps.play.aim import CANCEL, REACH, Aim, from_drag, towards
from minigolf_env.courses import load_course
from minigolf_env.rendering import Camera
from minigolf_env.rendering.camera import follow_view

SIZE = 960, 600
BALL = np.array([0.35, 0.625, 0.02135])


def camera() -> Camera:
    """Return where a player looks from."""
    return follow_view(load_course("dogleg"), BALL, SIZE[0] / SIZE[1])


def pixel(place: np.ndarray) -> np.ndarray:
    """Return where a place (3,) is in the window, pixels, y up."""
    x, y, _, w = camera().clip_from_world(SIZE[0] / SIZE[1]) @ np.append(place, 1.0)
    return np.array([(x / w + 1.0) * SIZE[0] / 2.0, (y / w + 1.0) * SIZE[1] / 2.0])


@pytest.mark.parametrize("degrees", range(0, 360, 30))
def test_the_putt_leaves_the_ball_straight_away_from_the_mouse(degrees: int) -> None:
    """In the picture the putt points against the drag, whatever the perspective."""
    drag = 150.0 * np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    aim = from_drag(camera(), BALL, (drag[0], drag[1]), SIZE)
    assert aim is not None
    seen = pixel(BALL + 1e-4 * aim.direction) - pixel(BALL)
    assert seen @ drag / np.linalg.norm(seen) / np.linalg.norm(drag) == pytest.approx(-1.0, abs=1e-4)


def test_power_is_the_length_of_the_drag() -> None:
    """A longer drag is a stronger putt, up to the full one; a very short one is none."""
    powers = [from_drag(camera(), BALL, (0.0, -share * SIZE[1]), SIZE) for share in (0.1, 0.2, REACH, 0.9)]
    assert powers[0] and powers[1] and powers[2] and powers[3]
    assert powers[0].power < powers[1].power < powers[2].power
    assert powers[2].power == pytest.approx(1.0) == powers[3].power
    assert from_drag(camera(), BALL, (0.0, -0.9 * CANCEL * SIZE[1]), SIZE) is None


def test_a_ball_behind_the_camera_can_be_aimed_at() -> None:
    """Where the picture says nothing, the putt goes along the line of sight."""
    eye = Camera((1.0, 0.0, 0.5), (2.0, 0.0, 0.5))
    aim = from_drag(eye, np.zeros(3), (0.0, -100.0), SIZE)
    assert aim is not None
    assert aim.direction == pytest.approx((1.0, 0.0, 0.0))


def test_keys_turn_and_strengthen() -> None:
    """Turning keeps the power, more power keeps the direction, and power stays between its bounds."""
    aim = towards(camera(), 0.5)
    assert aim.turned(90.0).power == pytest.approx(0.5)
    assert aim.turned(90.0).direction @ aim.direction == pytest.approx(0.0, abs=1e-12)
    assert aim.stronger(0.2).power == pytest.approx(0.7)
    assert aim.stronger(0.2).direction == pytest.approx(aim.direction)
    assert aim.stronger(9.0).power == pytest.approx(1.0)
    assert 0.0 < aim.stronger(-9.0).power < 0.05


def test_a_throw_is_raised() -> None:
    """The elevation lifts the direction, whose plan stays."""
    assert Aim(0.0, 0.4, elevation=30.0).direction == pytest.approx((0.0, math.sqrt(0.75), 0.5))
