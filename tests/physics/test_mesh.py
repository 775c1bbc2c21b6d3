"""TriangleMesh: which meshes are closed, which are refused, and that input arrays are copied."""

import numpy as np
import pytest

from minigolf_env.physics import Surface, TriangleMesh
from tests.physics.scenes import Body, box, cone, grid, groove, sphere, tetrahedron

CORNERS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
CLOSED_BODIES = {"box": box([0, 0, 0], [1, 1, 1]), "sphere": sphere([0, 0, 0], 1.0), "cone": cone([0, 0, 0], 1.0, 1.0)}


@pytest.mark.parametrize("kind", CLOSED_BODIES)
def test_closed_meshes_are_one_sided(kind: str) -> None:
    """Closed and consistently wound meshes are one-sided, with shared or repeated vertices, -0.0 or 0.0."""
    vertices, faces = CLOSED_BODIES[kind]
    unshared = vertices[faces].reshape(-1, 3)
    assert not TriangleMesh(vertices, faces).two_sided
    assert not TriangleMesh(
        np.where(unshared == 0.0, -0.0, unshared), np.arange(len(unshared)).reshape(-1, 3)
    ).two_sided


@pytest.mark.parametrize("body", [grid(1.0, 2), groove(0.5), (np.array(CORNERS), np.array([[0, 1, 2]]))])
def test_open_meshes_are_two_sided(body: Body) -> None:
    """A mesh with a boundary is two-sided, and two_sided=False is refused."""
    assert TriangleMesh(*body).two_sided
    with pytest.raises(ValueError, match=r"lawn: two_sided: expected .* received False; an edge of face 0, .* close"):
        TriangleMesh(*body, two_sided=False, name="lawn")


def test_mesh_with_a_missing_or_flipped_face_is_two_sided() -> None:
    """A hole, or one face with reversed winding, makes a body two-sided."""
    vertices, faces = tetrahedron([0, 0, 0], 1.0)
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not TriangleMesh(vertices, faces).two_sided
    assert TriangleMesh(vertices, faces[1:]).two_sided
    assert TriangleMesh(vertices, flipped).two_sided


@pytest.mark.parametrize("fault", ["missing", "flipped"])
def test_rejects_one_sided_mesh_and_names_a_faulty_face(fault: str) -> None:
    """A one-sided body with a hole or a flipped face is refused, and a face next to the fault is named."""
    vertices, faces = grid(1.0, 4)
    number = len(faces) + 5
    wrong = np.delete(np.concatenate([faces, faces[:, ::-1]]), number, axis=0)
    if fault == "flipped":
        wrong = np.insert(wrong, number, faces[5], axis=0)
    with pytest.raises(ValueError, match="two_sided") as error:
        TriangleMesh(vertices, wrong, two_sided=False)
    neighbour_vertices = set(faces[5].tolist())
    named = [face for face in wrong if f"{face.tolist()}" in str(error.value)]
    assert any(len(neighbour_vertices & set(face.tolist())) >= 2 for face in named)


@pytest.mark.parametrize("value", ["no", 2, 0.5, []])
def test_rejects_two_sided_values_that_are_not_boolean(value: object) -> None:
    """Any other value of two_sided is refused, not taken for true."""
    with pytest.raises(ValueError, match=r"two_sided: expected None, True or False, received"):
        TriangleMesh(CORNERS, [[0, 1, 2]], two_sided=value)  # type: ignore[arg-type]


def test_mesh_copies_its_arrays() -> None:
    """Later changes of the input arrays have no effect, and the mesh's own arrays are read-only."""
    vertices = np.array(CORNERS)
    faces = np.array([[0, 1, 2]])
    body = TriangleMesh(vertices, faces)
    vertices[0] = 9.0
    faces[0] = 0
    assert body.triangles.tolist() == [CORNERS]
    for array in (body.vertices, body.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


BAD_MESHES = {
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


@pytest.mark.parametrize("fault", BAD_MESHES)
def test_rejects_bad_meshes_with_expected_and_received_values(fault: str) -> None:
    """The error has the mesh's name, the fault, what was expected and what was received."""
    vertices, faces, expected_words = BAD_MESHES[fault]
    with pytest.raises(ValueError, match="ramp") as error:
        TriangleMesh(vertices, faces, name="ramp")  # type: ignore[arg-type]
    assert all(word in str(error.value) for word in ["expected", "received", *expected_words])


def test_rejects_surface_of_another_type() -> None:
    """A number in place of the surface is refused."""
    with pytest.raises(ValueError, match=r"surface: expected a Surface, received float"):
        TriangleMesh(CORNERS, [[0, 1, 2]], surface=0.7)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["damping", "restitution", "tangential", "rolling"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf"), "0.5", True])
def test_rejects_bad_surface_values(name: str, value: object) -> None:
    """Ratios must lie in [0, 1], and the rolling resistance must be finite and >= 0."""
    with pytest.raises(ValueError, match=f"{name}: expected .* received"):
        Surface(**{name: value})  # type: ignore[arg-type]


def test_only_rolling_resistance_may_exceed_one() -> None:
    """Ratios above 1 are refused; a rolling resistance above 1 is accepted."""
    for name in ("damping", "restitution", "tangential"):
        with pytest.raises(ValueError, match=r"\[0, 1\]"):
            Surface(**{name: 1.01})
    Surface(rolling=1.01)


def test_surface_ratios_default_to_damping() -> None:
    """Restitution and tangential are the damping factor of the CS121 notes unless given."""
    plain = Surface(damping=0.4)
    split = Surface(damping=0.4, restitution=0.0, tangential=1.0)
    assert (plain.normal_restitution, plain.tangential_restitution) == (0.4, 0.4)
    assert (split.normal_restitution, split.tangential_restitution) == (0.0, 1.0)
