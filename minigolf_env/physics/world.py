"""The door of the physics: a World checks what it is given once and runs the compiled kernels on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from minigolf_env._validation import finite_array, one_of, positive_number
from minigolf_env.physics import step as kernels
from minigolf_env.physics.batch import NO_LOG, NO_PATH, check_clear, clearance_rows, shot_of, simulate_rows, sweep_rows
from minigolf_env.physics.bvh import build_tree
from minigolf_env.physics.jit import announced_compilation
from minigolf_env.physics.mesh import TriangleMesh
from minigolf_env.physics.sweep import Collision, sweep, sweep_scan
from minigolf_env.physics.traversal import new_walk
from minigolf_env.physics.triangles import triangle_records
from minigolf_env.physics.types import (
    IMPACT,
    RESULT,
    SURFACE,
    TOLERANCE,
    FloatArray,
    Hit,
    Scene,
    Shot,
    Status,
    Vec3,
)

IMPACTS = ("average", "conservative")

MOST_STEPS = 2**40


def sweep_sphere(start: ArrayLike, end: ArrayLike, radius: float, triangles: ArrayLike) -> Hit:
    """Return the first collision of a sphere moving from start to end with two-sided triangles, looking at each.

    Args:
        start: (3,) the centre at the start, m.
        end: (3,) the centre at the end, m.
        radius: m, > 0.
        triangles: (n, 3, 3) corners, m.

    Raises:
        ValueError: wrong shapes, values that are not finite, radius <= 0 or too small beside the coordinates.
    """
    radius = positive_number(radius, "radius", "give the sphere's radius in metres.")
    p, q = _point(start, "start"), _point(end, "end")
    corners = finite_array(triangles, (None, 3, 3), "triangles", "give three corners of x, y, z a triangle.")
    scale = max(radius, *(float(np.abs(array).max(initial=0.0)) for array in (p, q, corners)))
    _require_telling(radius, scale, "radius")
    with announced_compilation("sweep_sphere"):
        hit = sweep_scan(triangle_records(corners), Vec3(*p), Vec3(*(q - p)), radius, TOLERANCE * scale)
    return _hit_of(hit)


class World:
    """A room of triangle meshes in which one ball moves, compiled once and immutable.

    The time step is that of the CS121 notes (docs/physics.md): the average velocity over the step, a straight path, the
    exact first collision, a damped reflection, the rest of the step. Contacts too weak to bounce last: the ball slides
    or rolls, is braked, and rests.

    Guaranteed, whatever the speed and dt, with ``scale`` the largest coordinate and meshes as TriangleMesh asks for
    them: after every piece of a step the ball's clearance to every triangle is >= -1e-12 scale; no contact is missed,
    and none but a grazing one is late by more than 1e-12 scale; every step and every run ends. A step has at most 64
    pieces; should they run out, the rest of its time is dropped, and counted as ``exhausted``: time may be lost, never
    a contact. Results are the same bits whatever the batch, the number of threads, and what was asked before.

    Args:
        meshes: one or more TriangleMesh.
        ball_radius: m, > 0.
        gravity: (3,) m/s^2.
        dt: the time step, s, > 0.
        impact: "average": the notes' response, with the average velocity over the path; "conservative": with the
            velocity at the collision, corrected so that an impact keeps energy exactly.
        bounds: (2, 3) lower and upper corner, m: a ball whose centre leaves them is out of bounds; None: no bounds.

    Raises:
        ValueError: no mesh, a number out of its range or not finite, an unknown ``impact``.
    """

    def __init__(
        self,
        meshes: Sequence[TriangleMesh],
        ball_radius: float = 0.02135,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        dt: float = 1 / 120,
        impact: str = "average",
        bounds: ArrayLike | None = None,
    ) -> None:
        self.meshes = _checked_meshes(meshes)
        self.ball_radius = positive_number(ball_radius, "ball_radius", "a golf ball has 0.02135 m.")
        self.gravity = tuple(finite_array(gravity, (3,), "gravity", "the Earth's is (0, 0, -9.81) m/s^2.").tolist())
        self.dt = positive_number(dt, "dt", "1/120 s suits minigolf.")
        self.impact = one_of(impact, IMPACTS, "impact")
        self.bounds = _checked_bounds(bounds)
        corners = np.concatenate([mesh.triangles for mesh in self.meshes])
        self.scale = max(self.ball_radius, float(np.abs(corners).max()))
        _require_telling(self.ball_radius, self.scale, "ball_radius")
        with announced_compilation("World"):
            self._scene = self._compile(corners)

    def __deepcopy__(self, memo: dict[int, object]) -> World:
        """Return the world itself: it is immutable."""
        return self

    def _compile(self, corners: FloatArray) -> Scene:
        nodes, order = build_tree(corners)
        sizes = [len(mesh.faces) for mesh in self.meshes]
        triangles = triangle_records(corners)
        has_area = triangles["n"].any(axis=1)
        triangles["one_sided"] = np.repeat([not mesh.two_sided for mesh in self.meshes], sizes) & has_area
        triangles["surface"] = np.repeat(np.arange(len(sizes)), sizes)
        surfaces = [mesh.surface for mesh in self.meshes]
        return Scene(
            triangles=triangles[order],
            nodes=nodes,
            surfaces=np.array([(s.normal_share, s.tangential_share, s.rolling) for s in surfaces], SURFACE),
            radius=self.ball_radius,
            eps=TOLERANCE * self.scale,
            gravity=Vec3(*self.gravity),
            dt=self.dt,
            conservative=self.impact == "conservative",
            lower=Vec3(*self.bounds[0].tolist()),
            upper=Vec3(*self.bounds[1].tolist()),
        )

    def sweep(self, start: ArrayLike, end: ArrayLike) -> Hit:
        """Return the first collision of the ball on its way from start (3,) to end (3,), m.

        Raises:
            ValueError: wrong shapes or values that are not finite.
        """
        p, q = _point(start, "start"), _point(end, "end")
        with announced_compilation("sweep"):
            hit = sweep(self._scene, new_walk(), Vec3(*p), Vec3(*(q - p)))
        return _hit_of(hit)

    def sweep_batch(self, starts: ArrayLike, ends: ArrayLike) -> Hit:
        """Return the first collisions from starts (N, 3) to ends (N, 3), m: arrays, bit-equal to N calls of sweep.

        Raises:
            ValueError: wrong or different shapes, or values that are not finite.
        """
        p, q = checked_rows(starts, ends, "starts", "ends")
        alphas, normals, triangles = sweep_rows([self._scene], p, q - p)
        return Hit(triangles >= 0, alphas, normals, triangles)  # type: ignore[arg-type]

    def step(self, position: ArrayLike, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return position (3,) and velocity (3,) one dt later.

        Raises:
            ValueError: wrong shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = self._clear(_point(position, "position")), _point(velocity, "velocity")
        with announced_compilation("step"):
            moved = kernels.step(self._scene, kernels.new_scratch(), Vec3(*p), Vec3(*v), NO_LOG, 0, 0.0)
        return np.array(moved.p), np.array(moved.v)

    def simulate(self, position: ArrayLike, velocity: ArrayLike, max_time: float = 30.0, record: bool = False) -> Shot:
        """Run the ball until it rests, leaves the bounds, or ``max_time`` (s) is over.

        The result is bit-equal to calling ``step`` again and again. With ``record`` it holds path, times and contacts.
        A ball wholly inside a solid is not refused, which ``require_free`` would do: it moves out freely.

        Raises:
            ValueError: wrong shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = self._clear(_point(position, "position")), _point(velocity, "velocity")
        steps = self.steps(max_time)
        shot, begun = self._run(p, v, steps, NO_PATH, NO_LOG)
        if not record:
            return shot
        # Runs are deterministic: now that the size of the record is known, the same run fills it.
        path, log = np.empty((begun + 1, 4)), np.empty((shot.bounces, 8))
        self._run(p, v, steps, path, log)
        contacts = np.empty(shot.bounces, IMPACT)
        contacts["time"], contacts["position"] = log[:, 0], log[:, 1:4]
        contacts["normal"], contacts["triangle"] = log[:, 4:7], log[:, 7]
        times = np.append(np.arange(begun) * self.dt, shot.time)
        sub_steps = path[1:, 3].astype(np.int64)
        return shot._replace(path=path[:, :3].copy(), times=times, contacts=contacts, sub_steps=sub_steps)

    def _run(self, p: FloatArray, v: FloatArray, steps: int, path: FloatArray, log: FloatArray) -> tuple[Shot, int]:
        """Return how a run of one ball ends, and the number of time steps begun."""
        balls = kernels.Balls(p[None].copy(), v[None].copy(), np.empty(1, RESULT))
        with announced_compilation("simulate"):
            kernels.simulate_range(0, 1, self._scene, kernels.new_scratch(), steps, balls, path, log)
        time, status, begun, bounces, exhausted = balls.results[0].tolist()
        return Shot(balls.positions[0], balls.velocities[0], Status(status), time, bounces, exhausted), begun

    def simulate_batch(self, positions: ArrayLike, velocities: ArrayLike, max_time: float = 30.0) -> Shot:
        """Run N balls, each alone in the world, from positions (N, 3) with velocities (N, 3), on all numba threads.

        Returns a Shot of arrays, bit-equal to N calls of ``simulate`` whatever the number of threads.

        Raises:
            ValueError: wrong or different shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = checked_rows(positions, velocities, "positions", "velocities")
        self._clear(p)
        return shot_of(p, v, simulate_rows([self._scene], p, v, self.steps(max_time)))

    def clearance(self, position: ArrayLike) -> Any:
        """Return the distance from the ball's skin to the nearest triangle, m; negative where they intersect.

        Args:
            position: (3,) the ball's centre, or (N, 3) for N distances.

        Raises:
            ValueError: wrong shape or values that are not finite.
        """
        several = np.ndim(position) == 2
        p = _points(position, "position") if several else _point(position, "position")[None]
        clearances = clearance_rows([self._scene], p)
        return clearances if several else float(clearances[0])

    def require_free(self, position: ArrayLike) -> FloatArray:
        """Return a centre (3,), or N of them (N, 3), as an array if balls there are in free space.

        What an editor or a tee should ask: unlike ``clearance``, which has no side, this also finds a ball that is
        wholly inside a solid, or out of the room. It looks at every triangle.

        Raises:
            ValueError: a ball intersects a mesh, is inside a solid or outside the room; a wrong shape or values that
                are not finite.
        """
        several = np.ndim(position) == 2
        p = self._clear(_points(position, "position") if several else _point(position, "position"))
        balls = p.reshape(-1, 3)
        outside = np.ones(len(balls), np.bool_)
        rooms = []
        for mesh in self.meshes:
            if mesh.two_sided:
                continue
            turns = mesh.winding_number(balls)
            if mesh.volume < 0.0:
                rooms.append(mesh.name)
                outside &= turns > -0.5
            elif (turns > 0.5).any():
                inside = balls[(turns > 0.5).argmax()].tolist()
                raise ValueError(f"position: expected a ball in free space, {inside} is inside {mesh.name!r}.")
        if rooms and outside.any():
            ball = balls[outside.argmax()].tolist()
            raise ValueError(f"position: expected a ball in the room, {ball} is outside {rooms[0]!r}.")
        return p

    def _clear(self, p: FloatArray) -> FloatArray:
        """Return centres (3,) or (N, 3) unchanged, or raise a ValueError for the first ball that intersects a mesh."""
        check_clear([self._scene], p, self.scale)
        return p

    @property
    def scene(self) -> Scene:
        """What the kernels read."""
        return self._scene

    def steps(self, max_time: float) -> int:
        """Return the number of time steps that a duration (s) takes.

        Raises:
            ValueError: it is not a number > 0, or too large.
        """
        limit = positive_number(max_time, "max_time", "give the longest time to simulate in seconds.")
        if limit > MOST_STEPS * self.dt:
            raise ValueError(
                f"max_time: expected {MOST_STEPS * self.dt:g} s at most, received {max_time!r}; give less."
            )
        return max(1, math.ceil(limit / self.dt - 1e-9))


def _hit_of(found: Collision) -> Hit:
    """Return a collision as plain numbers, which it is not if Python ran the kernels (NUMBA_DISABLE_JIT=1)."""
    return Hit(bool(found.row >= 0), float(found.alpha), np.array(found.normal), int(found.order))


def _require_telling(radius: float, scale: float, what: str) -> None:
    least = 4.0 * TOLERANCE * scale
    if radius <= least:
        raise ValueError(
            f"{what}: expected more than {least:g} m among coordinates up to {scale:g} m, received {radius!r}; "
            "float64 cannot tell such a ball from a point."
        )


def _point(value: ArrayLike, what: str) -> FloatArray:
    return finite_array(value, (3,), what, "give x, y, z.")


def _points(value: ArrayLike, what: str) -> FloatArray:
    return finite_array(value, (None, 3), what, "give one row of x, y, z a ball.")


def checked_rows(a: ArrayLike, b: ArrayLike, what_a: str, what_b: str) -> tuple[FloatArray, FloatArray]:
    """Return two tables (N, 3) of one length as arrays, or raise a ValueError."""
    rows_a, rows_b = _points(a, what_a), _points(b, what_b)
    if len(rows_a) != len(rows_b):
        raise ValueError(f"{what_b}: expected as many rows as {what_a}, {len(rows_a)}, received {len(rows_b)}.")
    return rows_a, rows_b


def _checked_meshes(meshes: Sequence[TriangleMesh]) -> tuple[TriangleMesh, ...]:
    if isinstance(meshes, TriangleMesh):
        raise ValueError("meshes: expected a list of TriangleMesh, received one TriangleMesh; write World([mesh]).")
    try:
        checked = tuple(meshes)
    except TypeError:
        kind = type(meshes).__name__
        raise ValueError(f"meshes: expected a list of TriangleMesh, received {kind}; write World([mesh]).") from None
    if not checked or not all(isinstance(mesh, TriangleMesh) for mesh in checked):
        received = [type(mesh).__name__ for mesh in checked]
        raise ValueError(f"meshes: expected at least one TriangleMesh, received {received}.")
    return checked


def _checked_bounds(bounds: ArrayLike | None) -> FloatArray:
    if bounds is None:
        return np.array([[-np.inf] * 3, [np.inf] * 3])
    checked = finite_array(bounds, (2, 3), "bounds", "give the lower and the upper corner.")
    if not (checked[0] < checked[1]).all():
        raise ValueError(f"bounds: expected lower < upper, received {checked.tolist()}; give the lower corner first.")
    return checked
