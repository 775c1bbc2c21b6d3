"""A simulator of a ball among triangle meshes with exact collision; numpy and numba only."""

from minigolf_env.physics.mesh import TriangleMesh
from minigolf_env.physics.types import Hit, Shot, Status, Surface
from minigolf_env.physics.world import World, sweep_sphere
from minigolf_env.physics.worlds import WorldBatch

__all__ = ["Hit", "Shot", "Status", "Surface", "TriangleMesh", "World", "WorldBatch", "sweep_sphere"]
