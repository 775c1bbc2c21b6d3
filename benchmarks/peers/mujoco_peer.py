"""MuJoCo: convex pieces, planes and height fields; no continuous collision detection; rays."""

from __future__ import annotations

import mujoco
import numpy as np

from benchmarks.peers.engine import GRAVITY, Engine
from benchmarks.scenes import RADIUS, ROOM, FloatArray, Scene

SCENERY, BALLS = 1, 2
"""Bits of contype and conaffinity."""


class Mujoco(Engine):
    """A model in which six planes stand in for the room, and convex pieces or a height field for what is in it.

    Bodies without a stand-in are left out. A ball is a point mass on three slides.
    """

    name = "mujoco"
    cast_kind = "ray"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        spec = mujoco.MjSpec()
        spec.option.timestep, spec.option.gravity = dt, (0.0, 0.0, -GRAVITY)
        spec.default.geom.friction = (scene.surface.rolling, 0.0, 0.0)
        # Restitution is a damper that turns an approach at v into a departure at e v within one step. It does so only
        # with contacts as hard as can be and a round friction cone: at the defaults 0.7 becomes 0.8, and 1 explodes.
        spec.default.geom.solref = (-1.0, -(1.0 + scene.surface.normal_restitution) / dt)
        spec.default.geom.solimp = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        _add_scenery(spec, scene)
        for _ in range(balls):
            body = spec.worldbody.add_body()
            for axis in np.eye(3):
                body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            body.add_geom(size=(RADIUS, 0.0, 0.0), contype=BALLS, conaffinity=SCENERY)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Put the balls somewhere."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos, self.data.qvel = positions.ravel(), velocities.ravel()

    def step(self, steps: int) -> None:
        """Move all balls, in one call."""
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        return self.data.qpos.reshape(-1, 3).copy(), self.data.qvel.reshape(-1, 3).copy()

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Send rays one at a time: mujoco has no sphere cast, and its batch shares one start."""
        geom, distances = np.empty((1, 1), np.int32), []
        for start, way in zip(starts, ends - starts):
            distances.append(mujoco.mj_ray(self.model, self.data, start, way, None, 1, -1, geom))
        shares = np.array(distances)
        return np.where((shares < 0.0) | (shares > 1.0), 1.0, shares)


def _add_scenery(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Add planes, convex pieces and height fields."""
    bits = {"contype": SCENERY, "conaffinity": BALLS}
    for corner, inwards in ((ROOM[0], 1.0), (ROOM[1], -1.0)):
        for normal in inwards * np.eye(3):
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, pos=corner, zaxis=normal, size=(4, 4, 1), **bits)
    for body in scene.bodies:
        for k, piece in enumerate(body.pieces):
            name = f"{body.name} {k} at {piece[0]}"
            spec.add_mesh(name=name, uservert=piece.ravel())
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **bits)
        if body.heights is not None:
            low, rise = body.heights.min(), np.ptp(body.heights)
            rows, columns = body.heights.shape
            size = (*(np.ptp(ROOM, axis=0)[:2] / 2), rise, low)
            spec.add_hfield(
                name=body.name, size=size, nrow=rows, ncol=columns, userdata=((body.heights - low) / rise).ravel()
            )
            place = (*ROOM.mean(axis=0)[:2], low)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=body.name, pos=place, **bits)
