"""Simulator of a ball in a scene of triangle meshes, with exact collision detection; numpy and numba only."""

from minigolf_env.physics.mesh import TriangleMesh
from minigolf_env.physics.types import Hit, Shot, Status, Surface
from minigolf_env.physics.world import World, WorldBatch, sweep_sphere

__all__ = ["Hit", "Shot", "Status", "Surface", "TriangleMesh", "World", "WorldBatch", "sweep_sphere"]
