"""Bullet, through pybullet: concave meshes, continuous collision detection, rays."""

from __future__ import annotations

import numpy as np
import pybullet

from benchmarks.peers.engine import GRAVITY_ACCELERATION, Engine
from benchmarks.scenes import BALL_RADIUS, FloatArray, Scene

MAX_STEPS_PER_CALL = 120
"""Largest number of steps per call; Bullet runs them as sub-steps of one long step, without the overhead of Python."""
MAX_RAYS_PER_CALL = 10_000
"""Largest number of rays per call, below pybullet's limit of 16,384 (MAX_RAY_INTERSECTION_BATCH_SIZE_STREAMING)."""
SCENERY_GROUP = 1
BALL_GROUP = 2
SWEPT_SPHERE_RADIUS = 0.9 * BALL_RADIUS
"""Radius of the sphere that Bullet sweeps, m; with the ball's radius the floor would stop it."""
ALLOWED_PENETRATION = 1e-4
"""Penetration that Bullet allows in a sweep, m; with its default, 0.04, balls leave the room through the walls."""


class Bullet(Engine):
    """A DIRECT connection with one static body for each mesh.

    Continuous collision detection needs maximal coordinates; without them Bullet ignores it silently.
    """

    name = "pybullet + CCD"
    cast_kind = "ray"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        self.dt = dt
        self._steps_per_call = 0
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -GRAVITY_ACCELERATION, physicsClientId=self.client)
        pybullet.setPhysicsEngineParameter(allowedCcdPenetration=ALLOWED_PENETRATION, physicsClientId=self.client)
        for body in scene.bodies:
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=body.vertices.tolist(),
                indices=body.faces.ravel().tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=self.client,
            )
            # Bullet multiplies the coefficients of the two bodies in contact: scenery has 1, the ball the material's.
            self._add(shape, SCENERY_GROUP, SCENERY_GROUP | BALL_GROUP, mass=0.0, restitution=1.0, lateralFriction=1.0)
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=BALL_RADIUS, physicsClientId=self.client)
        ball = {
            "restitution": scene.surface.normal_restitution,
            "lateralFriction": scene.surface.rolling,
            "mass": 1.0,
            "localInertiaDiagonal": (0.0, 0.0, 0.0),  # Bullet reads 0 as infinite: the ball cannot rotate.
            "ccdSweptSphereRadius": SWEPT_SPHERE_RADIUS,
            "activationState": pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        }
        self.balls = [self._add(shape, BALL_GROUP, SCENERY_GROUP, **ball) for _ in range(balls)]

    def _add(self, shape: int, group: int, mask: int, mass: float, **dynamics: object) -> int:
        body: int = pybullet.createMultiBody(mass, shape, useMaximalCoordinates=True, physicsClientId=self.client)
        pybullet.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=self.client)
        # The mass must be set again, or a change of inertia turns the ball's state into NaN.
        dynamics = {"mass": mass, "linearDamping": 0.0, "angularDamping": 0.0, **dynamics}
        pybullet.changeDynamics(body, -1, **dynamics, physicsClientId=self.client)
        return body

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Set positions and velocities."""
        for ball, position, velocity in zip(self.balls, positions.tolist(), velocities.tolist()):
            pybullet.resetBasePositionAndOrientation(ball, position, (0, 0, 0, 1), physicsClientId=self.client)
            pybullet.resetBaseVelocity(ball, velocity, (0, 0, 0), physicsClientId=self.client)

    def step(self, steps: int) -> None:
        """Advance all balls, with up to MAX_STEPS_PER_CALL steps per call."""
        while steps > 0:
            batch = min(steps, MAX_STEPS_PER_CALL)
            if batch != self._steps_per_call:
                pybullet.setPhysicsEngineParameter(
                    fixedTimeStep=batch * self.dt, numSubSteps=batch if batch > 1 else 0, physicsClientId=self.client
                )
                self._steps_per_call = batch
            pybullet.stepSimulation(physicsClientId=self.client)
            steps -= batch

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions = [pybullet.getBasePositionAndOrientation(b, physicsClientId=self.client)[0] for b in self.balls]
        velocities = [pybullet.getBaseVelocity(b, physicsClientId=self.client)[0] for b in self.balls]
        return np.array(positions), np.array(velocities)

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Cast rays; pybullet has no sphere cast."""
        fractions: list[float] = []
        for k in range(0, len(starts), MAX_RAYS_PER_CALL):
            rays = starts[k : k + MAX_RAYS_PER_CALL].tolist(), ends[k : k + MAX_RAYS_PER_CALL].tolist()
            fractions += [hit[2] for hit in pybullet.rayTestBatch(*rays, numThreads=1, physicsClientId=self.client)]
        return np.array(fractions)

    def close(self) -> None:
        """Disconnect; pybullet allows at most 1,024 connections."""
        pybullet.disconnect(physicsClientId=self.client)
