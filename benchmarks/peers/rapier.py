"""Rapier, through rapier3d: concave meshes, continuous collision detection, sphere casts; single precision."""

from __future__ import annotations

import numpy as np
import rapier3d as rp
from numpy.typing import NDArray

from benchmarks.peers.engine import GRAVITY_ACCELERATION, Engine
from benchmarks.scenes import BALL_RADIUS, Body, FloatArray, Scene

SCENERY_GROUP = rp.Group.GROUP_1
BALL_GROUP = rp.Group.GROUP_2


class Rapier(Engine):
    """A PhysicsWorld with one collider for each side of the room and one for each other mesh.

    Continuous collision detection ignores a collider that the ball touches already. A ball that rolls on a mesh would
    pass through the walls of the same mesh, so the room has a collider for each side.
    """

    name = "rapier3d + CCD"
    cast_kind = "sphere"

    def __init__(self, scene: Scene, balls: int = 1, dt: float = 1 / 120) -> None:
        self.world = rp.PhysicsWorld(gravity=(0.0, 0.0, -GRAVITY_ACCELERATION))
        self.world.set_num_threads(1)
        self.world.integration_parameters.dt = dt
        surface = scene.surface
        material = {
            "restitution": surface.normal_restitution,
            "friction": surface.rolling,
        }  # Rapier averages those of two bodies.
        room, *obstacles = scene.bodies
        for vertices, faces in [*_sides(room), *((body.vertices, body.faces) for body in obstacles)]:
            mesh = rp.Collider.trimesh(vertices, faces, **material)
            self.world.add_collider(mesh.collision_groups(rp.InteractionGroups(SCENERY_GROUP, BALL_GROUP)))
        builder = rp.RigidBody.dynamic(can_sleep=False, ccd_enabled=True).enabled_rotations((False, False, False))
        ball = rp.Collider.ball(BALL_RADIUS, **material).collision_groups(
            rp.InteractionGroups(BALL_GROUP, SCENERY_GROUP)
        )
        handles = [self.world.add_body(builder, [ball]) for _ in range(balls)]
        self.balls = [self.world.rigid_bodies[handle] for handle in handles]
        self.world.detect_collisions()  # Builds the acceleration structure for casts.

    def set(self, positions: FloatArray, velocities: FloatArray) -> None:
        """Set positions and velocities."""
        for ball, position, velocity in zip(self.balls, positions.tolist(), velocities.tolist()):
            ball.translation = position
            ball.linvel = velocity

    def step(self, steps: int) -> None:
        """Advance all balls, one step per call: rapier3d has no call for several."""
        step = self.world.step
        for _ in range(steps):
            step()

    def state(self) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities."""
        positions = [ball.translation.to_tuple() for ball in self.balls]
        return np.array(positions), np.array([ball.linvel.to_tuple() for ball in self.balls])

    def cast(self, starts: FloatArray, ends: FloatArray) -> FloatArray:
        """Cast the ball as a sphere."""
        ball = rp.SharedShape.ball(BALL_RADIUS)
        options = rp.ShapeCastOptions.with_max_time_of_impact(1.0)
        scenery = rp.QueryFilter(groups=rp.InteractionGroups(BALL_GROUP, SCENERY_GROUP))
        cast = self.world.query_pipeline.cast_shape
        poses = [rp.Isometry3(start) for start in starts.tolist()]
        hits = [cast(pose, delta, ball, options, scenery) for pose, delta in zip(poses, (ends - starts).tolist())]
        return np.array([1.0 if hit is None else hit[1].time_of_impact for hit in hits])


def _sides(body: Body) -> list[tuple[FloatArray, NDArray[np.int64]]]:
    """Return vertices and faces for each direction of the faces' normals."""
    a, b, c = np.moveaxis(body.vertices[body.faces], 1, 0)
    directions, side = np.unique(np.sign(np.cross(b - a, c - a)), axis=0, return_inverse=True)
    return [(body.vertices, body.faces[side.ravel() == k]) for k in range(len(directions))]
