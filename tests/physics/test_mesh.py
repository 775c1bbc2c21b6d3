"""The door for meshes: what is closed, what is refused, and that nothing of the caller's is kept."""

import numpy as np
import pytest

from minigolf_env.physics import Surface, TriangleMesh
from tests.physics.scenes import Body, box, cone, grid, groove, sphere, tetrahedron

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
CLOSED = {"box": box([0, 0, 0], [1, 1, 1]), "sphere": sphere([0, 0, 0], 1.0), "cone": cone([0, 0, 0], 1.0, 1.0)}


@pytest.mark.parametrize("kind", CLOSED)
def test_closed_meshes_are_one_sided(kind: str) -> None:
    """Closed and consistently wound, with shared or repeated vertices, -0.0 or 0.0: one-sided."""
    vertices, faces = CLOSED[kind]
    loose = vertices[faces].reshape(-1, 3)
    assert not TriangleMesh(vertices, faces).two_sided
    assert not TriangleMesh(np.where(loose == 0.0, -0.0, loose), np.arange(len(loose)).reshape(-1, 3)).two_sided


@pytest.mark.parametrize("body", [grid(1.0, 2), groove(0.5), (np.array(CORNERS), np.array([[0, 1, 2]]))])
def test_open_meshes_are_two_sided(body: Body) -> None:
    """A mesh with a border is two-sided, and cannot be told otherwise."""
    assert TriangleMesh(*body).two_sided
    with pytest.raises(ValueError, match=r"lawn: two_sided: expected .* received False; an edge of face 0, .* close"):
        TriangleMesh(*body, two_sided=False, name="lawn")


def test_mesh_with_a_face_missing_or_turned_is_two_sided() -> None:
    """A hole, or one face wound the wrong way, makes a body two-sided."""
    vertices, faces = tetrahedron([0, 0, 0], 1.0)
    turned = faces.copy()
    turned[0] = turned[0, ::-1]
    assert not TriangleMesh(vertices, faces).two_sided
    assert TriangleMesh(vertices, faces[1:]).two_sided
    assert TriangleMesh(vertices, turned).two_sided


@pytest.mark.parametrize("fault", ["missing", "turned"])
def test_one_sided_mesh_with_a_fault_is_refused_by_the_face(fault: str) -> None:
    """A body made one-sided with a hole or a turned face is refused, and a face beside the fault is named."""
    vertices, faces = grid(1.0, 4)
    number = len(faces) + 5
    wrong = np.delete(np.concatenate([faces, faces[:, ::-1]]), number, axis=0)
    if fault == "turned":
        wrong = np.insert(wrong, number, faces[5], axis=0)
    with pytest.raises(ValueError, match="two_sided") as error:
        TriangleMesh(vertices, wrong, two_sided=False)
    beside = set(faces[5].tolist())
    named = [face for face in wrong if f"{face.tolist()}" in str(error.value)]
    assert any(len(beside & set(face.tolist())) >= 2 for face in named)


@pytest.mark.parametrize("value", ["no", 2, 0.5, []])
def test_sides_must_be_none_true_or_false(value: object) -> None:
    """Anything else in the place of two_sided is refused, not taken for true."""
    with pytest.raises(ValueError, match=r"two_sided: expected None, True or False, received"):
        TriangleMesh(CORNERS, [[0, 1, 2]], two_sided=value)  # type: ignore[arg-type]


def test_mesh_keeps_copies() -> None:
    """Changing the arrays given afterwards changes nothing, and the mesh's own cannot be written."""
    vertices, faces = np.array(CORNERS), np.array([[0, 1, 2]])
    body = TriangleMesh(vertices, faces)
    vertices[0], faces[0] = 9.0, 0
    assert body.triangles.tolist() == [CORNERS]
    for array in (body.vertices, body.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


FAULTS = {
    "no vertices": ([], [[0, 1, 2]], ["vertices", "(N, 3)", "(0,)"]),
    "flat vertices": ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]], ["vertices", "(N, 3)", "(3, 2)"]),
    "text": ("corner", [[0, 1, 2]], ["vertices", "(N, 3)", "corner"]),
    "ragged vertices": ([[0.0, 0.0, 0.0], [1.0]], [[0, 1, 2]], ["vertices", "(N, 3)"]),
    "nan": ([[0.0, np.nan, 0.0], *CORNERS], [[0, 1, 2]], ["vertices", "finite", "nan", "(0, 1)"]),
    "inf": ([*CORNERS, [0.0, 0.0, -np.inf]], [[0, 1, 2]], ["vertices", "finite", "-inf", "(3, 2)"]),
    "huge": ([*CORNERS, [1e300, 0.0, 0.0]], [[0, 1, 2]], ["vertices", "1e+09", "1e+300"]),
    "no faces": (CORNERS, np.empty((0, 3), int), ["faces", "F >= 1", "(0, 3)"]),
    "quads": (CORNERS, [[0, 1, 2, 0]], ["faces", "(F, 3)", "(1, 4)", "split"]),
    "one face, flat": (CORNERS, [0, 1, 2], ["faces", "(F, 3)", "(3,)"]),
    "ragged faces": (CORNERS, [[0, 1, 2], [0, 1]], ["faces", "(F, 3)"]),
    "floats": (CORNERS, [[0.0, 1.0, 2.0]], ["faces", "integers", "float64"]),
    "booleans": (CORNERS, [[False, True, True]], ["faces", "integers", "bool"]),
    "too high": (CORNERS, [[0, 1, 2], [0, 1, 3]], ["faces", "0 to 2", "[0, 1, 3]", "face 1"]),
    "negative": (CORNERS, [[0, 1, -1]], ["faces", "0 to 2", "[0, 1, -1]", "face 0"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_bad_meshes_are_refused_with_what_expected_and_received(fault: str) -> None:
    """The error names the mesh, what is wrong, what is expected and what came."""
    vertices, faces, words = FAULTS[fault]
    with pytest.raises(ValueError, match="ramp") as error:
        TriangleMesh(vertices, faces, name="ramp")  # type: ignore[arg-type]
    assert all(word in str(error.value) for word in ["expected", "received", *words])


def test_surface_must_be_one() -> None:
    """A number in the place of the surface is refused."""
    with pytest.raises(ValueError, match=r"surface: expected a Surface, received float"):
        TriangleMesh(CORNERS, [[0, 1, 2]], surface=0.7)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["damping", "restitution", "tangential", "rolling"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf"), "0.5", True])
def test_bad_surfaces_are_refused(name: str, value: object) -> None:
    """Shares must lie in [0, 1] and the resistance must be finite and >= 0; the error says so."""
    with pytest.raises(ValueError, match=f"{name}: expected .* received"):
        Surface(**{name: value})  # type: ignore[arg-type]


def test_shares_are_at_most_one() -> None:
    """Only the resistance may be more than 1."""
    for name in ("damping", "restitution", "tangential"):
        with pytest.raises(ValueError, match=r"\[0, 1\]"):
            Surface(**{name: 1.01})
    Surface(rolling=1.01)


def test_surface_defaults_to_the_seeds_damping() -> None:
    """Restitution and tangential retention are the damping unless given."""
    plain, split = Surface(damping=0.4), Surface(damping=0.4, restitution=0.0, tangential=1.0)
    assert (plain.normal_restitution, plain.tangential_restitution) == (0.4, 0.4)
    assert (split.normal_restitution, split.tangential_restitution) == (0.0, 1.0)
