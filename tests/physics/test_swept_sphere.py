"""The sweep of one sphere against triangles is exact and has the symmetries of space."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from minigolf_env.physics import Hit, sweep_sphere
from tests.physics.oracle import Sweep
from tests.physics.scenes import FloatArray, grid, rotation

VECTORS = dict(np.load(Path(__file__).parents[1] / "data" / "sweep_vectors.npz"))
FLOOR = np.array([[[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [-1.0, 2.0, 0.0]]])
Case = tuple[FloatArray, FloatArray, float, FloatArray]


def scale_of(start: FloatArray, end: FloatArray, radius: float, triangles: FloatArray) -> float:
    """Return the largest coordinate of a case, which its tolerance is proportional to, m."""
    return max(1.0, radius, *(float(np.abs(array).max()) for array in (start, end, triangles)))


def fault_of(case: Case) -> str:
    """Return the difference of the package's result from the oracle's for one triangle; "" if there is none."""
    hit = sweep_sphere(*case)
    if hit.hit and not (np.isfinite(hit.normal).all() and abs(np.linalg.norm(hit.normal) - 1.0) < 1e-12):
        return f"normal {hit.normal} is not a unit vector"
    return Sweep(*case[:3], case[3][0]).fault(hit.hit, hit.alpha, 4e-12 * scale_of(*case))


def reference_faults(i: int) -> list[str]:
    """Return the differences from a reference vector's exact result, where hit or miss is certain."""
    start, end, radius, triangle = (VECTORS[name][i] for name in ("start", "end", "radius", "triangle"))
    alpha = float(VECTORS["alpha"][i])
    normal = VECTORS["normal"][i]
    margin = VECTORS["margin"][i]
    case = start, end, float(radius), triangle[None]
    answer = sweep_sphere(*case)
    scale = scale_of(*case)
    length = float(np.linalg.norm(end - start))
    faults = [fault_of(case)]
    if VECTORS["hit"][i] and margin > 1e-6 * scale and alpha > 0.0:
        speed = -float((end - start) @ normal) / length
        if not answer.hit:
            faults.append("missed")
        if speed > 1e-3 and abs(answer.alpha - alpha) * length > 4e-12 * scale / speed:
            faults.append(f"alpha {answer.alpha}, exact {alpha}")
        if speed > 1e-3 and radius > 1e-3 and np.linalg.norm(answer.normal - normal) > 1e-6 * scale / speed:
            faults.append(f"normal {answer.normal}, exact {normal}")
    if not VECTORS["hit"][i] and margin > 4e-12 * scale and answer.hit and answer.alpha > 0.0:
        faults.append("false hit")
    return [fault for fault in faults if fault]


@pytest.mark.parametrize("family", sorted(set(VECTORS["family"].tolist())))
def test_sweeps_agree_with_the_reference_vectors(family: str) -> None:
    """Hit, alpha and normal agree with the exact results in every family of the reference data."""
    wrong = [(int(i), faults) for i in np.flatnonzero(VECTORS["family"] == family) if (faults := reference_faults(i))]
    assert not wrong, f"{len(wrong)} of 400, first: {wrong[0]}"


def random_case(rng: np.random.Generator, family: str) -> Case:
    """Return a random case of a family; most aim at a point of the triangle, or just past its border."""
    triangle = rng.uniform(-1, 1, (3, 3))
    radius = float(rng.choice([0.02135, rng.uniform(0.005, 0.5)]))
    if family == "sliver":
        triangle[2] = triangle[0] + rng.random() * (triangle[1] - triangle[0])
        triangle[2] += rng.normal(size=3) * 10.0 ** rng.uniform(-18, -3)
    elif family == "degenerate":
        triangle = triangle[[[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 1, 1]][rng.integers(4)]]
    elif family == "needle and giant":
        triangle[1:] *= 10.0 ** rng.uniform(-6, 3)
    elif family == "tip":
        first, second = rng.permutation(3)[:2]
        triangle[second] = triangle[first] + rng.normal(size=3) * 10.0 ** rng.uniform(-15, -3)
    weights = rng.dirichlet([0.5, 0.5, 0.5])
    target = weights @ triangle
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    exponents = {"tiny path": (-9, -3), "long path": (1, 4)}.get(family, (-2, 0.3))
    length = 10.0 ** rng.uniform(*exponents)
    perpendicular = np.cross(direction, rng.normal(size=3))
    distance_ratio = rng.choice([1.0, 1.0 - 1e-7, 1.0 + 1e-7, 0.999]) if family == "graze" else 1.2 * rng.random()
    start = (
        target
        + distance_ratio * radius * perpendicular / np.linalg.norm(perpendicular)
        - direction * length * rng.random()
    )
    if family in ("touching start", "inside start"):
        start = target + direction * radius * (1.0 if family == "touching start" else rng.random())
        direction = rng.normal(size=3)
    if family == "skim":
        face = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        face /= np.linalg.norm(face)
        direction = np.cross(face, direction) / np.linalg.norm(np.cross(face, direction))
        start = target + radius * face - rng.random() * length * direction
        drop = 10.0 ** rng.uniform(-13, -9)
        start = start + rng.uniform(-1, 1) * drop * face
        direction = direction - drop / length * face
    if family == "tip":
        direction = triangle.mean(axis=0) - triangle[first] + 0.2 * rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        start = triangle[first] - (radius + 10.0 ** rng.uniform(-9, 0)) * direction
    if family == "far":
        shift = rng.uniform(-1, 1, 3) * 1e6
        start = start + shift
        triangle = triangle + shift
    return start, start + direction * length, radius, triangle[None]


FAMILIES = ["random", "graze", "sliver", "degenerate", "needle and giant"]
FAMILIES += ["far", "skim", "tip", "tiny path", "long path"]


@pytest.mark.parametrize("family", [*FAMILIES, "touching start", "inside start"])
def test_exact_oracle_accepts_generated_cases(family: str) -> None:
    """The oracle finds no missed, false or late hit in generated cases of difficult families."""
    rng = np.random.default_rng(7)
    cases = [random_case(rng, family) for _ in range(300)]
    faults = [(i, fault_of(case)) for i, case in enumerate(cases)]
    wrong = [(i, fault) for i, fault in faults if fault]
    assert not wrong, f"{len(wrong)} of {len(cases)}, first: {wrong[0]}"


coordinate = st.floats(-2, 2, allow_subnormal=False).map(lambda x: round(x, 3))
vector = st.tuples(coordinate, coordinate, coordinate).map(np.array)
soups = st.lists(st.tuples(vector, vector, vector), min_size=1, max_size=6).map(np.array)


def has_same_bits(a: Hit, b: Hit) -> bool:
    """Return whether two hits are equal bit for bit, apart from the triangle's index."""
    return a.hit == b.hit and a.alpha == b.alpha and np.array_equal(a.normal, b.normal)


@settings(max_examples=200, deadline=None)
@given(vector, vector, soups, st.integers(-30, 30))
def test_scaling_a_sweep_by_powers_of_two_keeps_the_bits(
    start: FloatArray, end: FloatArray, soup: FloatArray, k: int
) -> None:
    """A world 2**k times as large gives the same bits: no length is built in."""
    unit = 2.0**k
    answer = sweep_sphere(start, end, 0.25, soup)
    scaled = sweep_sphere(unit * start, unit * end, unit * 0.25, unit * soup)
    assert has_same_bits(answer, scaled)
    assert answer.triangle == scaled.triangle


@settings(max_examples=200, deadline=None)
@given(vector, vector, soups, st.permutations(range(6)))
def test_order_of_triangles_does_not_matter(
    start: FloatArray, end: FloatArray, soup: FloatArray, shuffle: list[int]
) -> None:
    """Shuffled triangles give the same bits, and the index of a triangle that alone gives them too."""
    order = [i for i in shuffle if i < len(soup)]
    corner = np.full((1, 3, 3), 50.0)  # A distant triangle gives all sweeps the same scale.
    answer, shuffled = (sweep_sphere(start, end, 0.25, np.concatenate([s, corner])) for s in (soup, soup[order]))
    assert has_same_bits(answer, shuffled)
    if answer.hit:
        alone = np.concatenate([soup[[order[shuffled.triangle]]], corner])
        assert has_same_bits(answer, sweep_sphere(start, end, 0.25, alone))


@settings(max_examples=100, deadline=None)
@given(vector, vector, soups)
def test_brute_force_sweep_is_the_first_hit_of_its_triangles(
    start: FloatArray, end: FloatArray, soup: FloatArray
) -> None:
    """Alpha for many triangles is the smallest alpha of the sweeps against each (with a common scale)."""
    corner = np.full((1, 3, 3), 50.0)  # A distant triangle gives all sweeps the same scale.
    each = [sweep_sphere(start, end, 0.25, np.concatenate([soup[[i]], corner])).alpha for i in range(len(soup))]
    assert sweep_sphere(start, end, 0.25, np.concatenate([soup, corner])).alpha == min(each)


def clear_cases(count: int) -> list[tuple[Case, Hit]]:
    """Return random cases with one triangle and a steep hit, whose result survives moving the world."""
    rng = np.random.default_rng(11)
    cases = []
    while len(cases) < count:
        case = random_case(rng, "random")
        hit = sweep_sphere(*case)
        if hit.hit and 0.05 < hit.alpha < 0.95 and -hit.normal @ (case[1] - case[0]) > 0.05:
            cases.append((case, hit))
    return cases


@pytest.mark.parametrize("kind", ["translated", "rotated", "reflected"])
def test_sweep_is_invariant_under_translation_rotation_and_reflection(kind: str) -> None:
    """Moving, rotating or mirroring the world does the same to the result, up to rounding."""
    rng = np.random.default_rng(3)
    for (start, end, radius, triangles), hit in clear_cases(100):
        rot = {"translated": np.eye(3), "rotated": rotation(rng), "reflected": np.diag([-1.0, 1.0, 1.0])}[kind]
        shift = rng.uniform(-3, 3, 3) if kind == "translated" else np.zeros(3)
        other = sweep_sphere(rot @ start + shift, rot @ end + shift, radius, triangles @ rot.T + shift)
        assert other.hit
        assert other.alpha == pytest.approx(hit.alpha, abs=1e-9)
        assert other.normal == pytest.approx(rot @ hit.normal, abs=1e-7)


def test_sphere_touches_at_alpha_and_not_before() -> None:
    """At alpha the distance is the radius; at half of alpha it is more."""
    for (start, end, radius, triangles), hit in clear_cases(100):
        sweep = Sweep(start, end, radius, triangles[0])
        assert sweep.is_deeper(hit.alpha, -1e-11)
        assert not sweep.is_deeper(hit.alpha, 1e-11)
        assert not sweep.is_deeper(0.5 * hit.alpha, 0.0)


def test_splitting_a_path_keeps_the_hit() -> None:
    """A path split before its hit has none in the first part and the same hit in the second."""
    for (start, end, radius, triangles), hit in clear_cases(100):
        middle = start + 0.5 * hit.alpha * (end - start)
        assert not sweep_sphere(start, middle, radius, triangles).hit
        rest = sweep_sphere(middle, end, radius, triangles)
        fraction = 0.5 * hit.alpha + rest.alpha * (1.0 - 0.5 * hit.alpha)
        assert fraction == pytest.approx(hit.alpha, abs=1e-10)


def test_hand_worked_face_edge_and_vertex() -> None:
    """Unit paths onto a face, an edge and a vertex have the hit fraction of Pythagoras' theorem."""
    r = 0.25
    face = sweep_sphere([0, 0, 1], [0, 0, 0], r, FLOOR)
    edge = sweep_sphere([0, -1.15, 1], [0, -1.15, 0], r, FLOOR)
    vertex = sweep_sphere([-1.1, -1.1, 1], [-1.1, -1.1, 0], r, FLOOR)
    assert face == Hit(True, 0.75, pytest.approx([0, 0, 1], abs=0), 0)
    assert edge.alpha == pytest.approx(1 - math.sqrt(r**2 - 0.15**2), abs=1e-12)
    assert edge.normal == pytest.approx([0, -0.6, 0.8], abs=1e-10)
    assert vertex.alpha == pytest.approx(1 - math.sqrt(r**2 - 0.02), abs=1e-12)


def test_contact_at_the_end_of_a_path_is_a_hit_of_the_next_path() -> None:
    """A path that ends in contact has alpha 1 and no hit; a path that continues from there has alpha 0."""
    assert sweep_sphere([0, 0, 1], [0, 0, 0.25], 0.25, FLOOR) == Hit(False, 1.0, pytest.approx([0, 0, 0], abs=0), -1)
    assert sweep_sphere([0, 0, 0.25], [0, 0, 0], 0.25, FLOOR).alpha == 0.0


@pytest.mark.parametrize("direction", [[0, 0, 1], [1, 0, 0], [1, 0, 1e-9], [0, 0, 0]])
def test_contact_is_a_hit_only_when_approaching(direction: list[float]) -> None:
    """A sphere in contact that separates, moves along the face, or does not move, has no hit."""
    start = np.array([0.0, 0.0, 0.25])
    assert not sweep_sphere(start, start + direction, 0.25, FLOOR).hit


def test_two_sided_triangle_has_the_mirrored_normal_for_the_mirrored_path() -> None:
    """The hit fractions are equal and the normals opposite."""
    down, up = sweep_sphere([0, 0, 1], [0, 0, -1], 0.25, FLOOR), sweep_sphere([0, 0, -1], [0, 0, 1], 0.25, FLOOR)
    assert down.alpha == up.alpha
    assert np.array_equal(down.normal, -up.normal)


def test_simultaneous_hits_prefer_the_steepest_then_the_first_triangle() -> None:
    """The face with the steepest approach counts if several are hit at one instant; of equal ones the first."""
    wall = np.array([[[0.0, -9.0, -9.0], [0.0, 9.0, -9.0], [0.0, 0.0, 9.0]]])
    floor = np.array([[[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]]])
    start = np.array([1.25, 0.0, 1.25])
    direction = np.array([-1.0, 0.0, -1.0])
    both = np.concatenate([wall, floor, wall, floor])
    assert sweep_sphere(start, start + 2 * direction, 0.25, both).triangle == 0
    assert sweep_sphere(start, start + 2 * direction, 0.25, both[[1, 0]]).triangle == 0
    # Both in contact at the start (alpha 0): the steeper counts, in either order.
    touching = np.array([0.25, 0.0, 0.25])
    for order in ([0, 1], [1, 0]):
        hit = sweep_sphere(touching, touching + np.array([-0.1, 0, -0.3]), 0.25, both[order])
        assert hit.alpha == 0.0
        assert np.array_equal(hit.normal, [0, 0, 1])


def test_inner_edges_of_a_flat_floor_have_the_face_normal() -> None:
    """On seams and vertices inside a flat floor the normal is the face's, to the last bit."""
    vertices, faces = grid(4.0, 4)
    for x, y in ((0.0, 0.0), (0.5, 0.5), (0.3, 0.0), (0.0, 0.7), (0.3, 0.3)):
        hit = sweep_sphere([x - 0.1, y, 1], [x, y, 0], 0.25, vertices[faces])
        assert np.array_equal(hit.normal, [0, 0, 1])
        assert not sweep_sphere([x - 2, y, 0.25], [x + 2, y, 0.25], 0.25, vertices[faces]).hit


def test_path_approaches_along_the_reported_normal() -> None:
    """The normal always points against the path, also where a grazed edge gets its face's normal."""
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(3000):
        tilt = 10.0 ** rng.uniform(-11, -4, 2) * rng.choice([-1, 1], 2)
        floor = np.array([[[0, -1, 0], [1, -1, tilt[0]], [0, 1, 0]], [[0, -1, 0], [0, 1, 0], [-1, -1, tilt[1]]]])
        start = np.array([-0.01, 0.0, 0.02 + tilt[1] * 0.01 + rng.uniform(-2, 2) * 1e-12])
        end = start + np.array([0.02, 0.0, rng.normal() * 1e-11])
        hit = sweep_sphere(start, end, 0.02, floor)
        hits += hit.hit
        assert not hit.hit or hit.normal @ (end - start) < 0.0
    assert hits > 100


def test_grazing_within_the_tolerance_is_no_hit() -> None:
    """A sphere that passes an edge less deep than the tolerance has no hit."""
    floor = np.array([[[0.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]])
    for length in (1e-3, 1e-2, 1e-1):
        for depth in (0.0, 1e-13, 2e-13, 3e-13):
            start, end = np.array([-length, -0.5, 0.02 - 1e-12 - depth]), np.array([length, -0.5, 0.02 + 1e-12 - depth])
            assert not sweep_sphere(start, end, 0.02, floor).hit
            assert not sweep_sphere(end, start, 0.02, floor).hit


@pytest.mark.parametrize("depth", [-1e-12, 0.0, 1e-13, 3e-13, 8e-13, 1e-12, 1e-9, 1e-6])
def test_ridge_edge_is_hit_exactly_when_deeper_than_the_tolerance(depth: float) -> None:
    """The tolerance is 5e-13 for a tangential path across an edge from which a face falls away."""
    rng = np.random.default_rng(3)
    for _ in range(500):
        tilt = 10.0 ** rng.uniform(-4, -0.5)
        angle = rng.uniform(-1.3, 1.3)
        fraction = rng.uniform(0.1, 0.9)
        ridge = np.array([[[0.0, -1.0, 0.0], [1.0, -1.0, -tilt], [0.0, 1.0, 0.0]]])
        direction = 10.0 ** rng.uniform(-2, -1) * np.array([np.cos(angle), np.sin(angle), 0.0])
        start = np.array([0.0, rng.uniform(-0.5, 0.5), 0.02 - depth]) - fraction * direction
        for a, b in ((start, start + direction), (start + direction, start)):
            assert sweep_sphere(a, b, 0.02, ridge).hit == (depth > 5e-13)
