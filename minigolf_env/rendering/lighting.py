"""Light and its constants, shared by the shaders and by the compiled drawing of pixel observations. No OpenGL."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LinearColor = tuple[float, float, float]
"""Linear red, green and blue."""

TO_SUN = np.array([-0.46, -0.38, 0.80])
"""Vector (3,) to the sun, of any length."""


class Lighting(NamedTuple):
    """The light of all scenes; program.py #defines each field for the shaders, named in capitals.

    The values were chosen by eye.
    """

    sun_direction: tuple[float, float, float]
    """Unit vector to the sun."""
    sunlight: LinearColor = (1.30, 1.22, 1.08)
    """Direct light of the sun."""
    skylight: LinearColor = (0.40, 0.47, 0.58)
    """Ambient light from above."""
    groundlight: LinearColor = (0.20, 0.19, 0.15)
    """Ambient light from below."""
    penumbra_growth: float = 0.08
    """Half-width of the penumbra of the ball's shadow per metre of distance, m; the real sun's 0.005 would hardly be
    visible."""
    contact_penumbra: float = 0.04
    """Half-width of the penumbra next to the ball, radii of the ball."""
    occlusion_range: float = 4.0
    """Distance up to which the ball darkens its surroundings (ambient occlusion), radii of the ball."""
    occlusion_strength: float = 0.85
    """Share of the hidden ambient light that a surface loses."""
    min_ball_ambient: float = 0.55
    """Share of the ambient light that reaches the lowest point of the ball."""
    marker_albedo: float = 0.93
    """Albedo of the marker that is drawn for the ball in small images."""
    ghost_opacity: float = 0.3
    """Opacity of the ball, in white, where something hides it."""
    tone_gain: float = 0.12
    """Coefficient c of the tone mapping x (1 + c x) / (1 + d x), which compresses bright colours."""
    tone_compression: float = 0.55
    """Coefficient d of the tone mapping."""
    max_root_albedo: float = 1.8
    """Square root of the greatest albedo that a G-buffer stores; steep water with a white tint has up to 1.78."""


LIGHTING = Lighting(sun_direction=tuple((TO_SUN / np.linalg.norm(TO_SUN)).tolist()))
"""The light of all scenes."""
