"""A little of the soak: no ball into a wall, out of a room, or out of time, whatever the room."""

import numpy as np
import pytest

from minigolf_env.physics import World
from tests.physics.scenes import box, mesh
from tools.soak import Room, Tally, soak_room

ROOMS = 10
"""In each of the tests below: about 100,000 steps."""


HARD = (1_000_001, 1_000_039, 1_000_066, 1_000_427)
"""Rooms in which the sub-steps of some steps once ran out; test_termination.py has the reasons in small scenes."""


@pytest.mark.parametrize("seed", HARD)
def test_rooms_in_which_time_was_lost(seed: int) -> None:
    """Rooms that the soak once found fault with stay without."""
    total = soak_room(seed)
    assert not total.faults, str(total)


@pytest.mark.parametrize("first", range(0, 300, ROOMS))
def test_soak(first: int) -> None:
    """After every step the clearance is at least -1e-12 of the scale, the ball in its room, and no time was lost."""
    total = Tally()
    for seed in range(first, first + ROOMS):
        total.add(soak_room(seed))
    assert not total.faults, str(total)
    assert (total.rooms, total.bounces > 0, total.steps > 10_000) == (ROOMS, True, True)


def test_soak_knows_where_a_ball_is() -> None:
    """Points before, behind and outside of a parted room are told apart."""
    room = Room(World([mesh(box([0, 0, 0], [1, 1, 1]))]), 2.0 * np.eye(3), 0.25)
    sides = room.sides(np.array([[0.6, 0, 1], [0.4, 0, 1], [1.1, 0, 1], [0, 0, -0.1], [0, 0, 2.1]]))
    assert np.array_equal(sides, [1, -1, np.nan, np.nan, np.nan], equal_nan=True)


def test_soak_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clearance below the guarantee is a fault that says how to see it again."""
    monkeypatch.setattr("tools.soak.GUARANTEE", 1.0)
    total = soak_room(0)
    assert "build_room(0)" in total.faults[0]
    assert "clearance >=" in str(total)
