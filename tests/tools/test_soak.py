"""A short soak: in random rooms no ball penetrates a wall, escapes or loses time."""

import numpy as np
import pytest

from minigolf_env.physics import World
from tests.physics.scenes import box, mesh
from tools.soak import Room, Tally, soak_room

ROOMS_PER_TEST = 10
"""Number of rooms in each test; about 100,000 steps."""

FORMER_FAULTS = (1_000_001, 1_000_039, 1_000_066, 1_000_427)
"""RNG seeds of rooms in which steps once ran out of sub-steps; test_termination.py has the causes in small scenes."""


@pytest.mark.parametrize("seed", FORMER_FAULTS)
def test_rooms_that_once_lost_time_have_no_faults(seed: int) -> None:
    """Rooms in which the soak once found faults have none."""
    tally = soak_room(seed)
    assert not tally.faults, str(tally)


@pytest.mark.parametrize("first", range(0, 300, ROOMS_PER_TEST))
def test_random_rooms_have_no_faults(first: int) -> None:
    """After every step the clearance is at least -1e-12 of the scale, the ball is in its room, and no time is lost."""
    total = Tally()
    for seed in range(first, first + ROOMS_PER_TEST):
        total.add(soak_room(seed))
    assert not total.faults, str(total)
    assert (total.rooms, total.bounces > 0, total.steps > 10_000) == (ROOMS_PER_TEST, True, True)


def test_sides_of_a_divided_room() -> None:
    """Points in front of the wall, behind it and outside the room have the sides 1, -1 and NaN."""
    room = Room(World([mesh(box([0, 0, 0], [1, 1, 1]))]), 2.0 * np.eye(3), 0.25)
    sides = room.sides(np.array([[0.6, 0, 1], [0.4, 0, 1], [1.1, 0, 1], [0, 0, -0.1], [0, 0, 2.1]]))
    assert np.array_equal(sides, [1, -1, np.nan, np.nan, np.nan], equal_nan=True)


def test_fault_report_has_the_code_that_reproduces_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clearance below the guarantee is reported with its room."""
    monkeypatch.setattr("tools.soak.MIN_CLEARANCE", 1.0)
    tally = soak_room(0)
    assert "build_room(0)" in tally.faults[0]
    assert "clearance >=" in str(tally)
