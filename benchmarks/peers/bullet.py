"""Bullet, through pybullet: concave meshes, continuous collision detection, rays."""

from __future__ import annotations

import numpy as np
import pybullet

from benchmarks.peers.engine import GRAVITY, Engine
from benchmarks.scenes import RADIUS, FloatArray, Scene

MOST_STEPS = 120
"""Steps a call: Bullet takes them as sub-steps of one long step, which spares the way through Python."""
MOST_RAYS = 10_000
"""Rays a call, below pybullet's limit of 16,384 (MAX_RAY_INTERSECTION_BATCH_SIZE_STREAMING)."""
SCENERY, BALLS = 1, 2
"""Collision groups."""
SWEPT = 0.9 * RADIUS
"""Radius of the sphere that Bullet sweeps, m: as large as the ball, it would be stopped by the floor it rolls on."""
ALLOWED_PENETRATION = 1e-4
"""What Bullet lets a sweep go through, m: at its default, 0.04, balls leave the room through its walls."""


class Bullet(Engine):
    """A DIRECT connection with one static body for each mesh.

    Continuous collision detection works only with maximal coordinates: without them Bullet ignores it and says nothing.
    """

    name = "pybullet + CCD"
    cast_kind = "ray"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        self.dt, self.steps_a_call = dt, 0
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(allowedCcdPenetration=ALLOWED_PENETRATION, physicsClientId=self.client)
        for body in scene.bodies:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=body.vertices.tolist(),
                indices=body.faces.ravel().tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=self.client,
            )
            # Bullet multiplies the coefficients of the two bodies in contact: scenery has 1, the ball all.
            self._add(shape, SCENERY, SCENERY | BALLS, mass=0.0, restitution=1.0, lateralFriction=1.0)
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS, physicsClientId=self.client)
        ball = {
            "restitution": scene.surface.normal_restitution,
            "lateralFriction": scene.surface.rolling,
            "mass": 1.0,
            "localInertiaDiagonal": (0.0, 0.0, 0.0),  # To Bullet 0 means infinite: the ball cannot turn.
            "ccdSweptSphereRadius": SWEPT,
            "activationState": pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        }
        self.balls = [self._add(shape, BALLS, SCENERY, **ball) for _ in range(balls)]

    def _add(self, shape: int, group: int, mask: int, mass: float, **dynamics: object) -> int:
        body: int = pybullet.createMultiBody(mass, shape, useMaximalCoordinates=True, physicsClientId=self.client)
        pybullet.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=self.client)
        # The mass again: without it a change of inertia turns the ball's state into NaN.
        dynamics = {"mass": mass, "linearDamping": 0.0, "angularDamping": 0.0, **dynamics}
        pybullet.changeDynamics(body, -1, **dynamics, physicsClientId=self.client)
        return body

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Put the balls somewhere."""
        for ball, position, velocity in zip(self.balls, positions.tolist(), velocities.tolist()):
            pybullet.resetBasePositionAndOrientation(ball, position, (0, 0, 0, 1), physicsClientId=self.client)
            pybullet.resetBaseVelocity(ball, velocity, (0, 0, 0), physicsClientId=self.client)

    def step(self, steps: int) -> None:
        """Move all balls, as many steps a call as Bullet takes."""
        while steps > 0:
            now = min(steps, MOST_STEPS)
            if now != self.steps_a_call:
                pybullet.setPhysicsEngineParameter(
                    fixedTimeStep=now * self.dt, numSubSteps=now if now > 1 else 0, physicsClientId=self.client
                )
                self.steps_a_call = now
            pybullet.stepSimulation(physicsClientId=self.client)
            steps -= now

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions = [pybullet.getBasePositionAndOrientation(b, physicsClientId=self.client)[0] for b in self.balls]
        velocities = [pybullet.getBaseVelocity(b, physicsClientId=self.client)[0] for b in self.balls]
        return np.array(positions), np.array(velocities)

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Send rays: pybullet has no sphere cast."""
        shares: list[float] = []
        for k in range(0, len(starts), MOST_RAYS):
            ways = starts[k : k + MOST_RAYS].tolist(), ends[k : k + MOST_RAYS].tolist()
            shares += [ray[2] for ray in pybullet.rayTestBatch(*ways, numThreads=1, physicsClientId=self.client)]
        return np.array(shares)

    def close(self) -> None:
        """Disconnect: pybullet keeps at most 1,024 connections."""
        pybullet.disconnect(physicsClientId=self.client)
