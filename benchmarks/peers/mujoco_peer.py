"""MuJoCo: convex pieces, planes and height fields; no continuous collision detection; rays."""

from __future__ import annotations

import mujoco
import numpy as np

from benchmarks.peers.engine import GRAVITY_ACCELERATION, Engine
from benchmarks.scenes import BALL_RADIUS, ROOM_BOUNDS, FloatArray, Scene

SCENERY_GROUP = 1
"""Bit of contype and conaffinity for the scene."""
BALL_GROUP = 2
"""Bit of contype and conaffinity for balls."""


class Mujoco(Engine):
    """A model with six planes for the room, and convex pieces or a height field for its bodies.

    Bodies without either are left out. A ball is a point mass on three slide joints.
    """

    name = "mujoco"
    cast_kind = "ray"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        spec = mujoco.MjSpec()
        spec.option.timestep = dt
        spec.option.gravity = (0.0, 0.0, -GRAVITY_ACCELERATION)
        spec.default.geom.friction = (scene.surface.rolling, 0.0, 0.0)
        # Restitution is a damper that turns an approach at v into a separation at e v within one step. This needs the
        # hardest contacts and an elliptic friction cone: with the defaults 0.7 becomes 0.8, and 1 diverges.
        spec.default.geom.solref = (-1.0, -(1.0 + scene.surface.normal_restitution) / dt)
        spec.default.geom.solimp = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        _add_scenery(spec, scene)
        for _ in range(balls):
            body = spec.worldbody.add_body()
            for axis in np.eye(3):
                body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
            body.add_geom(size=(BALL_RADIUS, 0.0, 0.0), contype=BALL_GROUP, conaffinity=SCENERY_GROUP)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Set positions and velocities."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos = positions.ravel()
        self.data.qvel = velocities.ravel()

    def step(self, steps: int) -> None:
        """Advance all balls, in one call."""
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        return self.data.qpos.reshape(-1, 3).copy(), self.data.qvel.reshape(-1, 3).copy()

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Cast rays one at a time; mujoco has no sphere cast, and the rays of a batch share one start."""
        geom = np.empty((1, 1), np.int32)
        distances = []
        for start, delta in zip(starts, ends - starts):
            distances.append(mujoco.mj_ray(self.model, self.data, start, delta, None, 1, -1, geom))
        fractions = np.array(distances)
        return np.where((fractions < 0.0) | (fractions > 1.0), 1.0, fractions)


def _add_scenery(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Add planes, convex pieces and height fields."""
    bits = {"contype": SCENERY_GROUP, "conaffinity": BALL_GROUP}
    for corner, inwards in ((ROOM_BOUNDS[0], 1.0), (ROOM_BOUNDS[1], -1.0)):
        for normal in inwards * np.eye(3):
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, pos=corner, zaxis=normal, size=(4, 4, 1), **bits)
    for body in scene.bodies:
        for k, piece in enumerate(body.pieces):
            name = f"{body.name} {k} at {piece[0]}"
            spec.add_mesh(name=name, uservert=piece.ravel())
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **bits)
        if body.heights is not None:
            lowest = body.heights.min()
            rise = np.ptp(body.heights)
            rows, columns = body.heights.shape
            size = (*(np.ptp(ROOM_BOUNDS, axis=0)[:2] / 2), rise, lowest)
            spec.add_hfield(
                name=body.name, size=size, nrow=rows, ncol=columns, userdata=((body.heights - lowest) / rise).ravel()
            )
            center = (*ROOM_BOUNDS.mean(axis=0)[:2], lowest)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=body.name, pos=center, **bits)
