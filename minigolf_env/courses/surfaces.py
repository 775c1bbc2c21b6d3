"""Surfaces that course files name without describing them, and those that they describe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from minigolf_env.courses.course import Material
from minigolf_env.courses.shapes import SurfaceRecord
from minigolf_env.physics import Surface


class Look(NamedTuple):
    """How something plays, and what it looks like."""

    surface: Surface
    material: Material
    color: str | None


KNOWN = {
    # Landing costs a ball no speed along the floor; rolling brakes it: a fast green.
    "felt": SurfaceRecord(restitution=0.3, tangential=1.0, stimp=10.0, material="felt"),
    # Curved ground is made of facets: a ball that meets the next one keeps what is along it, and does not hop.
    "slope": SurfaceRecord(restitution=0.0, tangential=1.0, stimp=10.0, material="felt"),
    "track": SurfaceRecord(restitution=0.0, tangential=1.0, rolling=0.01, material="paint", color="#d8a013"),
    # Borders and obstacles: the seed's single damping.
    "wood": SurfaceRecord(damping=0.7, material="wood"),
    "stone": SurfaceRecord(damping=0.7, material="stone"),
    "brick": SurfaceRecord(damping=0.7, material="brick"),
    "roof": SurfaceRecord(damping=0.7, material="paint", color="#6b2d22"),
    "water": SurfaceRecord(damping=0.0, material="water"),
    # Takes so much speed that the ball soon lies still, and that no ball that strikes the rim clears the border. It
    # brakes a rolling ball no more than felt, or balls would hang on the rim.
    "lining": SurfaceRecord(damping=0.5, restitution=0.2, stimp=10.0, material="cup"),
}
"""A course file may give each of them anew."""


def known_surfaces(described: Mapping[str, SurfaceRecord]) -> dict[str, Look]:
    """Return all surfaces by name: the known ones and a file's own."""
    return {name: _look(record) for name, record in {**KNOWN, **described}.items()}


def _look(record: SurfaceRecord) -> Look:
    rolling = Surface.rolling
    if record.rolling is not None:
        rolling = record.rolling
    elif record.stimp is not None:
        rolling = stimp_rolling(record.stimp)
    surface = Surface(record.damping, record.restitution, record.tangential, rolling)
    return Look(surface, record.material, record.color)


def stimp_rolling(stimp: float) -> float:
    """Return the rolling resistance of a green whose speed is given in feet on a stimpmeter (PHYSICS: 1.829 m/s)."""
    return 1.829**2 / (2.0 * 0.3048 * stimp) / 9.81
