"""Surfaces of course files: the record that describes one, and the built-in ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, NamedTuple

from pydantic import Field

from minigolf_env.courses.course import Material, rolling_resistance_from_stimp
from minigolf_env.courses.schema.record import Fraction, HexColor, Record
from minigolf_env.physics import Surface


class SurfaceRecord(Record):
    """Physical properties and appearance of a surface."""

    damping: Fraction = 0.7
    """Fraction of the velocity that an impact keeps."""
    restitution: Fraction | None = None
    """Fraction of the normal velocity that an impact keeps. Default: ``damping``."""
    tangential: Fraction | None = None
    """Fraction of the tangential velocity that an impact keeps. Default: ``damping``."""
    rolling: Annotated[float, Field(strict=True, ge=0.0, le=1000.0)] | None = None
    """Coefficient of rolling resistance. It takes precedence over ``stimp``. Default: that of
    ``minigolf_env.physics.Surface``."""
    stimp: Annotated[float, Field(strict=True, gt=0.0, le=1000.0)] | None = None
    """Rolling resistance as the speed of a green in feet on a stimpmeter: 8 is slow, 12 is fast."""
    material: Material = "wood"
    """Texture the surface is drawn with."""
    color: HexColor | None = None
    """Colour the texture is tinted with, such as "#c03020". Default: the material's own colour."""


class SurfaceAppearance(NamedTuple):
    """Physical surface together with its material and colour."""

    surface: Surface
    material: Material
    color: str | None
    """Colour such as "#c03020"; None: the material's own."""


BUILTIN_SURFACES = {
    # A fast green: landing keeps the velocity along the floor, and rolling resistance slows the ball.
    "felt": SurfaceRecord(restitution=0.3, tangential=1.0, stimp=10.0, material="felt"),
    # Curved ground is made of facets: a ball that rolls onto the next facet keeps its tangential velocity and does not
    # hop.
    "slope": SurfaceRecord(restitution=0.0, tangential=1.0, stimp=10.0, material="felt"),
    "track": SurfaceRecord(restitution=0.0, tangential=1.0, rolling=0.01, material="paint", color="#d8a013"),
    # Borders and obstacles: the single damping coefficient of the CS121 notes.
    "wood": SurfaceRecord(damping=0.7, material="wood"),
    "stone": SurfaceRecord(damping=0.7, material="stone"),
    "brick": SurfaceRecord(damping=0.7, material="brick"),
    "roof": SurfaceRecord(damping=0.7, material="paint", color="#6b2d22"),
    "water": SurfaceRecord(damping=0.0, material="water"),
    # An impact takes so much speed that the ball soon comes to rest in the cup, and that no ball that strikes the rim
    # clears the border. Rolling resistance is that of felt: with more, balls would come to rest on the rim.
    "lining": SurfaceRecord(damping=0.5, restitution=0.2, stimp=10.0, material="cup"),
}
"""Surfaces that every course file can name; a file may redefine each of them."""


def collect_surfaces(described: Mapping[str, SurfaceRecord]) -> dict[str, SurfaceAppearance]:
    """Return all surfaces that a course file can name: the built-in ones, and the file's own in their place."""
    return {name: _appearance(record) for name, record in {**BUILTIN_SURFACES, **described}.items()}


def _appearance(record: SurfaceRecord) -> SurfaceAppearance:
    rolling = Surface.rolling
    if record.rolling is not None:
        rolling = record.rolling
    elif record.stimp is not None:
        rolling = rolling_resistance_from_stimp(record.stimp)
    surface = Surface(record.damping, record.restitution, record.tangential, rolling)
    return SurfaceAppearance(surface, record.material, record.color)
