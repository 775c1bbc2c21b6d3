"""The public API of the physics: arguments are validated once, then the compiled kernels run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from minigolf_env._validation import count_axes, finite_array, one_of, positive_number, quote
from minigolf_env.physics import step as kernels
from minigolf_env.physics.batch import (
    NO_LOG,
    check_no_overlap,
    clearance_rows,
    make_shot,
    simulate_recorded,
    simulate_rows,
    sweep_rows,
)
from minigolf_env.physics.bvh import build_bvh
from minigolf_env.physics.jit import notify_if_compiling
from minigolf_env.physics.mesh import TriangleMesh
from minigolf_env.physics.sweep import Collision, sweep, sweep_brute_force
from minigolf_env.physics.traversal import new_traversal
from minigolf_env.physics.triangles import build_triangles
from minigolf_env.physics.types import (
    RELATIVE_TOLERANCE,
    SURFACE_DTYPE,
    CompiledScene,
    FloatArray,
    Hit,
    Shot,
    Status,
    Vec3,
)

IMPACT_MODELS = ("average", "conservative")
"""Values of the argument ``impact``."""

MAX_STEPS = 2**40
"""Maximum number of time steps of a run; ``max_time`` may ask for no more."""

STEP_COUNT_TOLERANCE = 1e-9
"""Fraction of a step by which ``max_time`` may exceed a multiple of dt, by rounding, without an additional step."""


def sweep_sphere(start: ArrayLike, end: ArrayLike, radius: float, triangles: ArrayLike) -> Hit:
    """Return the first hit of a sphere moving from start to end with two-sided triangles, by testing each.

    Args:
        start: (3,) the centre at the start, m.
        end: (3,) the centre at the end, m.
        radius: m, > 0.
        triangles: (n, 3, 3) vertices, m.

    Raises:
        ValueError: wrong shapes, values that are not finite, radius <= 0 or too small compared with the coordinates.
    """
    radius = positive_number(radius, "radius", "give the sphere's radius in metres.")
    p, q = _point(start, "start"), _point(end, "end")
    triangle_vertices = finite_array(
        triangles, (None, 3, 3), "triangles", "give three vertices (x, y, z) per triangle."
    )
    scale = max(radius, *(float(np.abs(array).max(initial=0.0)) for array in (p, q, triangle_vertices)))
    _check_radius_resolvable(radius, scale, "radius")
    with notify_if_compiling("sweep_sphere"):
        hit = sweep_brute_force(
            build_triangles(triangle_vertices), Vec3(*p), Vec3(*(q - p)), radius, RELATIVE_TOLERANCE * scale
        )
    return _public_hit(hit)


class World:
    """A scene of triangle meshes in which one ball moves, compiled once and immutable: setting an attribute raises.

    The time step is that of the CS121 notes (docs/physics.md): the average velocity over the step, a straight path, the
    exact first hit, a damped reflection, the rest of the step. Impacts whose rebound would end within the step become
    resting contacts: the ball slides or rolls, slows down by rolling resistance, and rests.

    Guarantees at any speed and dt, for meshes that meet the requirements of TriangleMesh; ``coordinate_scale`` is the
    largest coordinate: after every sub-step the ball's clearance to every triangle is >= -1e-12 coordinate_scale; no
    contact is missed, and none but a grazing one is late by more than 1e-12 coordinate_scale; every step and every run
    ends. A step has at most 64 sub-steps; should they be used up, the rest of its time is dropped, and counted as
    ``exhausted``: time may be lost, never a contact. Results are the same bits whatever the batch, the number of
    threads, and the calls before.

    Args:
        meshes: one or more TriangleMesh.
        ball_radius: m, > 0.
        gravity: (3,) m/s^2.
        dt: the time step, s, > 0.
        impact: "average": the notes' response, with the average velocity over the path, except for short hops of a
            damped ball (docs/physics.md, "Impact response"); "conservative": with the velocity at the impact,
            corrected so that an undamped impact conserves energy, up to rounding.
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
        self.meshes = _validated_meshes(meshes)
        self.ball_radius = positive_number(ball_radius, "ball_radius", "a golf ball has 0.02135 m.")
        self.gravity = tuple(finite_array(gravity, (3,), "gravity", "the Earth's is (0, 0, -9.81) m/s^2.").tolist())
        self.dt = positive_number(dt, "dt", "1/120 s suits minigolf.")
        self.impact = one_of(impact, IMPACT_MODELS, "impact")
        self.bounds = _validated_bounds(bounds)
        triangle_vertices = np.concatenate([mesh.triangles for mesh in self.meshes])
        self.coordinate_scale = max(self.ball_radius, float(np.abs(triangle_vertices).max()))
        _check_radius_resolvable(self.ball_radius, self.coordinate_scale, "ball_radius")
        with notify_if_compiling("World"):
            self.scene = self._compile(triangle_vertices)

    def __setattr__(self, name: str, value: object) -> None:
        """Raise an AttributeError after construction: the compiled scene would not change."""
        if "scene" in self.__dict__:
            raise AttributeError(f"World.{name} cannot be set: a World is immutable; make a new World.")
        super().__setattr__(name, value)

    def __deepcopy__(self, memo: dict[int, object]) -> World:
        """Return the world itself: it is immutable."""
        return self

    def _compile(self, triangle_vertices: FloatArray) -> CompiledScene:
        """Build the arrays that the compiled code reads."""
        nodes, order = build_bvh(triangle_vertices)
        sizes = [len(mesh.faces) for mesh in self.meshes]
        triangles = build_triangles(triangle_vertices)
        has_area = triangles["n"].any(axis=1)
        triangles["one_sided"] = np.repeat([not mesh.two_sided for mesh in self.meshes], sizes) & has_area
        triangles["surface"] = np.repeat(np.arange(len(sizes)), sizes)
        surfaces = [mesh.surface for mesh in self.meshes]
        materials = [(s.normal_restitution, s.tangential_restitution, s.rolling) for s in surfaces]
        return CompiledScene(
            triangles=triangles[order],
            nodes=nodes,
            surfaces=np.array(materials, SURFACE_DTYPE),
            radius=self.ball_radius,
            eps=RELATIVE_TOLERANCE * self.coordinate_scale,
            gravity=Vec3(*self.gravity),
            dt=self.dt,
            conservative=self.impact == "conservative",
            lower=Vec3(*self.bounds[0].tolist()),
            upper=Vec3(*self.bounds[1].tolist()),
        )

    def sweep(self, start: ArrayLike, end: ArrayLike) -> Hit:
        """Return the first hit of the ball on its way from start (3,) to end (3,), m.

        Raises:
            ValueError: wrong shapes or values that are not finite.
        """
        p, q = _point(start, "start"), _point(end, "end")
        with notify_if_compiling("sweep"):
            hit = sweep(self.scene, new_traversal(), Vec3(*p), Vec3(*(q - p)))
        return _public_hit(hit)

    def sweep_batch(self, starts: ArrayLike, ends: ArrayLike) -> Hit:
        """Return the first hits from starts (N, 3) to ends (N, 3), m: arrays, bit-equal to N calls of sweep.

        Raises:
            ValueError: wrong or different shapes, or values that are not finite.
        """
        p, q = _paired_points(starts, ends, "starts", "ends")
        alphas, normals, triangles = sweep_rows([self.scene], p, q - p)
        return Hit(triangles >= 0, alphas, normals, triangles)  # type: ignore[arg-type]

    def step(self, position: ArrayLike, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return position (3,) and velocity (3,) one dt later.

        Raises:
            ValueError: wrong shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = _point(position, "position"), _point(velocity, "velocity")
        check_no_overlap([self.scene], p, self.coordinate_scale)
        with notify_if_compiling("step"):
            result = kernels.step(self.scene, kernels.new_scratch(), Vec3(*p), Vec3(*v), NO_LOG, 0, 0.0)
        return np.array(result.p), np.array(result.v)

    def simulate(self, position: ArrayLike, velocity: ArrayLike, max_time: float = 30.0, record: bool = False) -> Shot:
        """Run the ball until it rests, leaves the bounds, or ``max_time`` (s) is over.

        The result is bit-equal to repeated calls of ``step``. With ``record`` it holds path, times and impacts. A ball
        wholly inside a solid is accepted here, and moves out freely; ``check_collision_free`` refuses it.

        Raises:
            ValueError: wrong shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = _point(position, "position"), _point(velocity, "velocity")
        check_no_overlap([self.scene], p, self.coordinate_scale)
        max_steps = self.num_steps_for(max_time)
        if record:
            return simulate_recorded(self.scene, p, v, max_steps)
        # Runs in place: p and v, copies of the arguments, become the final position and velocity.
        results = simulate_rows([self.scene], p[None], v[None], max_steps)
        time, status, _, bounces, exhausted = results[0].tolist()
        return Shot(p, v, Status(status), time, bounces, exhausted)

    def simulate_batch(self, positions: ArrayLike, velocities: ArrayLike, max_time: float = 30.0) -> Shot:
        """Run N balls, each alone in the world, from positions (N, 3) with velocities (N, 3).

        The batch runs on as many threads as numba is set to use. Returns a Shot of arrays, bit-equal to N calls of
        ``simulate`` whatever the number of threads.

        Raises:
            ValueError: wrong or different shapes, values that are not finite, or a ball that intersects a mesh.
        """
        p, v = _paired_points(positions, velocities, "positions", "velocities")
        check_no_overlap([self.scene], p, self.coordinate_scale)
        return make_shot(p, v, simulate_rows([self.scene], p, v, self.num_steps_for(max_time)))

    def clearance(self, position: ArrayLike) -> Any:
        """Return the distance from the ball's surface to the nearest triangle, m; negative where they intersect.

        Args:
            position: (3,) the ball's centre, or (N, 3) for N distances.

        Raises:
            ValueError: wrong shape or values that are not finite.
        """
        is_batch = count_axes(position) == 2
        p = _points(position, "position") if is_batch else _point(position, "position")[None]
        clearances = clearance_rows([self.scene], p)
        return clearances if is_batch else float(clearances[0])

    def check_collision_free(self, position: ArrayLike) -> FloatArray:
        """Return a centre (3,), or N of them (N, 3), as a validated array if balls there are in free space.

        Use it before a first shot from a place that a user chose, such as a tee. Unlike ``clearance``, which does not
        distinguish sides, it also refuses a ball wholly inside a solid or outside the room. It tests every triangle.

        Raises:
            ValueError: a ball intersects a mesh, is inside a solid or outside the room; a wrong shape or values that
                are not finite.
        """
        is_batch = count_axes(position) == 2
        p = _points(position, "position") if is_batch else _point(position, "position")
        check_no_overlap([self.scene], p, self.coordinate_scale)
        balls = p.reshape(-1, 3)
        is_outside = np.ones(len(balls), np.bool_)
        rooms = []
        for mesh in self.meshes:
            if mesh.two_sided:
                continue
            winding = mesh.winding_number(balls)
            if mesh.volume < 0.0:  # Wound inwards: a room.
                rooms.append(mesh.name)
                is_outside &= winding > -0.5
            elif (winding > 0.5).any():
                ball = balls[(winding > 0.5).argmax()].tolist()
                raise ValueError(
                    f"position: expected a ball in free space, received {ball}, which is inside {quote(mesh.name)}; "
                    "move it out of the solid."
                )
        if rooms and is_outside.any():
            ball = balls[is_outside.argmax()].tolist()
            raise ValueError(
                f"position: expected a ball in the room, received {ball}: it is outside {quote(rooms[0])}; move it in."
            )
        return p

    def num_steps_for(self, max_time: float) -> int:
        """Return the number of time steps that a duration (s) takes.

        Raises:
            ValueError: it is not a number > 0, or too large.
        """
        limit = positive_number(max_time, "max_time", "give the longest time to simulate in seconds.")
        if limit > MAX_STEPS * self.dt:
            raise ValueError(
                f"max_time: expected {MAX_STEPS * self.dt:g} s at most, received {quote(max_time)}; give less."
            )
        return max(1, math.ceil(limit / self.dt - STEP_COUNT_TOLERANCE))


class WorldBatch:
    """Batch of worlds that run on all threads, with the same bits as one world after another.

    A batch of M worlds takes N rows, a multiple of M. World after world has N / M consecutive rows.

    Args:
        worlds: worlds with the same time step ``dt``; an empty batch takes no rows.

    Raises:
        ValueError: different time steps.
    """

    def __init__(self, worlds: Sequence[World]) -> None:
        self.worlds = tuple(worlds)
        time_steps = {world.dt for world in self.worlds}
        if len(time_steps) > 1:
            raise ValueError(f"worlds: expected all of one dt, received {quote(sorted(time_steps))} s.")
        self._scenes = [world.scene for world in self.worlds]

    def simulate_batch(self, positions: ArrayLike, velocities: ArrayLike, max_time: float = 30.0) -> Shot:
        """Run balls from positions (N, 3) with velocities (N, 3), each in its world, as World.simulate_batch does.

        Raises:
            ValueError: as in World, or N is not a multiple of the number of worlds.
        """
        p, v = _paired_points(positions, velocities, "positions", "velocities")
        rows_per_world = self._rows_per_world(len(p), "positions")
        check_no_overlap(self._scenes, p, np.repeat([world.coordinate_scale for world in self.worlds], rows_per_world))
        max_steps = self.worlds[0].num_steps_for(max_time) if self.worlds else 0
        return make_shot(p, v, simulate_rows(self._scenes, p, v, max_steps))

    def sweep_batch(self, starts: ArrayLike, ends: ArrayLike) -> Hit:
        """Return the first hits from starts (N, 3) to ends (N, 3), m, each in its world, as World.sweep_batch does.

        Raises:
            ValueError: as in World, or N is not a multiple of the number of worlds.
        """
        p, q = _paired_points(starts, ends, "starts", "ends")
        self._rows_per_world(len(p), "starts")
        alphas, normals, triangles = sweep_rows(self._scenes, p, q - p)
        return Hit(triangles >= 0, alphas, normals, triangles)  # type: ignore[arg-type]

    def _rows_per_world(self, n: int, what: str) -> int:
        """Return the number of rows of each world, or raise a ValueError; ``what`` names the argument with n rows."""
        num_worlds = len(self.worlds)
        if n % num_worlds if num_worlds else n:
            raise ValueError(
                f"{what}: expected a multiple of {num_worlds} rows, received {n}; give each world as many rows."
            )
        return n // max(1, num_worlds)


def _public_hit(found: Collision) -> Hit:
    """Return a Collision as a Hit of plain numbers, also if Python ran the kernels (NUMBA_DISABLE_JIT=1)."""
    return Hit(bool(found.row >= 0), float(found.alpha), np.array(found.normal), int(found.triangle_id))


def _check_radius_resolvable(radius: float, scale: float, what: str) -> None:
    """Raise a ValueError if the radius is within the tolerance of the scale."""
    min_radius = 4.0 * RELATIVE_TOLERANCE * scale
    if radius <= min_radius:
        raise ValueError(
            f"{what}: expected more than {min_radius:g} m among coordinates up to {scale:g} m, received "
            f"{quote(radius)}; float64 cannot tell such a ball from a point."
        )


def _point(value: ArrayLike, what: str) -> FloatArray:
    return finite_array(value, (3,), what, "give x, y, z.")


def _points(value: ArrayLike, what: str) -> FloatArray:
    return finite_array(value, (None, 3), what, "give one row (x, y, z) per ball.")


def _paired_points(a: ArrayLike, b: ArrayLike, what_a: str, what_b: str) -> tuple[FloatArray, FloatArray]:
    """Return two tables (N, 3) of one length as arrays, or raise a ValueError."""
    rows_a, rows_b = _points(a, what_a), _points(b, what_b)
    if len(rows_a) != len(rows_b):
        raise ValueError(f"{what_b}: expected as many rows as {what_a}, {len(rows_a)}, received {len(rows_b)}.")
    return rows_a, rows_b


def _validated_meshes(meshes: Sequence[TriangleMesh]) -> tuple[TriangleMesh, ...]:
    if isinstance(meshes, TriangleMesh):
        raise ValueError("meshes: expected a list of TriangleMesh, received one TriangleMesh; write World([mesh]).")
    try:
        checked = tuple(meshes)
    except TypeError:
        kind = type(meshes).__name__
        raise ValueError(f"meshes: expected a list of TriangleMesh, received {kind}; write World([mesh]).") from None
    if not checked or not all(isinstance(mesh, TriangleMesh) for mesh in checked):
        received = [type(mesh).__name__ for mesh in checked]
        raise ValueError(f"meshes: expected at least one TriangleMesh, received {quote(received)}.")
    return checked


def _validated_bounds(bounds: ArrayLike | None) -> FloatArray:
    if bounds is None:
        return np.array([[-np.inf] * 3, [np.inf] * 3])
    checked = finite_array(bounds, (2, 3), "bounds", "give the lower and the upper corner.")
    if not (checked[0] < checked[1]).all():
        raise ValueError(f"bounds: expected lower < upper, received {checked.tolist()}; give the lower corner first.")
    return checked
