"""Layout of a level: a random lane and the place of the cup.

A lane consists of legs, straight stretches that turns connect. Each leg has features: obstacles, slopes, and steps of
the floor.
"""

from __future__ import annotations

from typing import NamedTuple

from minigolf_env.courses.course import Point3
from minigolf_env.courses.procedural.lane_builder import LaneBuilder
from minigolf_env.courses.procedural.lane_features import FEATURES_BY_DIFFICULTY
from minigolf_env.courses.procedural.portable_rng import PortableRng

GENERATOR_VERSION = 1
"""Version of the levels, a part of their names; it is raised whenever any level changes."""

TEE_LENGTH = 0.8
"""Length of the flat piece from the border behind the tee to the first feature, m."""

CUP_PIECE_HALF_LENGTH = 0.3
"""Half the length of the flat piece of the lane that contains the cup, m."""

MIN_CUP_TO_BORDER = 0.25
"""Smallest distance from the cup to the border on its left or right, m."""


class DifficultySettings(NamedTuple):
    """Ranges that the lane of a difficulty is drawn from, as pairs of the smallest and largest value."""

    legs: tuple[int, int]
    """Number of legs of the lane."""
    features: tuple[int, int]
    """Number of features on a leg."""
    widths: tuple[float, float]
    """Width at the tee, m."""
    steps: tuple[int, int]
    """Angle of a turn, in steps of 15 degrees."""


DIFFICULTY_SETTINGS = {
    "easy": DifficultySettings(legs=(1, 2), features=(0, 1), widths=(1.0, 1.3), steps=(3, 6)),
    "medium": DifficultySettings(legs=(2, 3), features=(1, 2), widths=(0.9, 1.25), steps=(2, 6)),
    "hard": DifficultySettings(legs=(3, 5), features=(1, 2), widths=(0.85, 1.2), steps=(2, 7)),
}
"""Settings of each difficulty."""

DIFFICULTY_NAMES = tuple(DIFFICULTY_SETTINGS)
"""Names of the difficulties, from easy to hard."""

MAX_LAYOUT_COORDINATE = 9.0
"""Largest absolute x or y of a lane, m."""

MAX_LAYOUT_ATTEMPTS = 50
"""Largest number of lanes that are drawn until one does not overlap itself; usually the first one does not."""


class Layout(NamedTuple):
    """Finished lane with a place for the cup."""

    lane: LaneBuilder
    """Lane from the tee to the end."""
    cup_section: int
    """Index of the cross-section before the cup; the next one is behind it."""
    cup: Point3
    """Centre of the cup's rim, m."""
    legs: int
    """Number of legs."""


def generate_layout(difficulty: str, rng: PortableRng) -> Layout:
    """Return a lane that does not overlap itself and stays within MAX_LAYOUT_COORDINATE."""
    for _ in range(MAX_LAYOUT_ATTEMPTS):
        layout = _sample_layout(difficulty, rng, rng.integer(*DIFFICULTY_SETTINGS[difficulty].legs))
        if layout.lane.max_coordinate() <= MAX_LAYOUT_COORDINATE and not layout.lane.overlaps_itself():
            return layout
    return _sample_layout(difficulty, rng, 1)


def _sample_layout(difficulty: str, rng: PortableRng, legs: int) -> Layout:
    settings = DIFFICULTY_SETTINGS[difficulty]
    # Left and right turns are equally frequent, so that on average the lane keeps its first direction.
    lane = LaneBuilder(width=rng.uniform(*settings.widths), heading=rng.integer(0, 23))
    lane.add_straight(TEE_LENGTH)
    for leg in range(legs):
        if leg > 0:
            _add_random_turn(lane, rng, rng.integer(*settings.steps))
        taper = rng.uniform(0.0, 1.0 / 16.0)
        lane.taper = -taper if lane.width > 1.05 else taper
        num_features = rng.integer(*settings.features) + (difficulty == "easy" and legs == 1)
        lane.add_straight(0.25)
        for _ in range(num_features):
            rng.choice(FEATURES_BY_DIFFICULTY[difficulty])(lane, rng)
        lane.add_straight(rng.uniform(0.2, 0.6))
    return _add_green(lane, rng, legs)


def _add_random_turn(lane: LaneBuilder, rng: PortableRng, steps: int) -> None:
    side = rng.sign()
    if rng.integer(0, 2) == 0:
        lane.add_bend(side * steps, rng.uniform(0.15, 0.5))
    else:
        lane.add_turn(side * steps, rng.choice(("square", "cut", "round")) if steps <= 6 else "round")
    lane.taper = 0.0
    lane.add_straight(0.15)


def _add_green(lane: LaneBuilder, rng: PortableRng, legs: int) -> Layout:
    """Add the flat part around the cup and the end of the lane."""
    # Add the flat piece that contains the cup.
    lane.taper = 0.0
    cup_section = len(lane.sections) - 1
    max_offset = lane.width / 2.0 - MIN_CUP_TO_BORDER
    left = rng.uniform(-max_offset, max_offset)
    cup = (*lane.point_at(CUP_PIECE_HALF_LENGTH, left), lane.z)
    lane.add_straight(2.0 * CUP_PIECE_HALF_LENGTH)
    lane.route.append(cup[:2])
    # Add the end, which is square, has cut corners, or is round.
    width = lane.width
    ending = rng.choice(("square", "cut", "round"))
    if ending == "cut":
        lane.add_straight(0.25, width=width - 0.4)
    elif ending == "round":
        for k in range(1, 6):
            lane.add_straight(0.08, width=width * (1.0 - 0.5 * (k / 5.0) ** 2))
    return Layout(lane, cup_section, cup, legs)
