"""Transforms of glTF nodes (glTF 2.0, section 3.5.3), and the two conventions for the axis that points up."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from trimesh.transformations import quaternion_matrix

from minigolf_env._validation import finite_array
from minigolf_env.courses.io.gltf_buffers import REPAIR_HINT, JsonObject

FloatArray: TypeAlias = NDArray[np.float64]

MAX_TRANSFORM_VALUE = 1e6
"""Largest value in the transform of a node."""

TRANSFORM_TOLERANCE = 1e-3
"""Largest error of a rotation's length and of a matrix's last row; 3D programs round both."""


def node_matrix(node: JsonObject) -> FloatArray:
    """Return the transform (4, 4) of a node in its parent."""
    if "matrix" in node:
        others = [key for key in ("translation", "rotation", "scale") if key in node]
        if others:
            raise ValueError(f"it has both a matrix and {others[0]}; export it with one of them")
        return check_transform(finite_array(node["matrix"], (16,), "its matrix", REPAIR_HINT).reshape(4, 4).T)
    x, y, z, w = finite_array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), (4,), "its rotation", REPAIR_HINT).tolist()
    if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) > TRANSFORM_TOLERANCE:
        raise ValueError(f"its rotation {(x, y, z, w)} is not a unit quaternion; {REPAIR_HINT}")
    matrix: FloatArray = quaternion_matrix([w, x, y, z]) if "rotation" in node else np.eye(4)  # type: ignore[no-untyped-call]
    matrix[:3, :3] = matrix[:3, :3] * finite_array(node.get("scale", (1.0, 1.0, 1.0)), (3,), "its scale", REPAIR_HINT)
    matrix[:3, 3] = finite_array(node.get("translation", (0.0, 0.0, 0.0)), (3,), "its translation", REPAIR_HINT)
    return check_transform(matrix)


def check_transform(matrix: FloatArray) -> FloatArray:
    """Return a transform (4, 4), or raise a ValueError if it is not affine or too large."""
    if not np.abs(matrix).max() <= MAX_TRANSFORM_VALUE:
        raise ValueError(f"its transform exceeds {MAX_TRANSFORM_VALUE:g}; {REPAIR_HINT}")
    if not np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() <= TRANSFORM_TOLERANCE:
        raise ValueError(f"its matrix is not affine; {REPAIR_HINT}")
    return matrix


def y_up_to_z_up(points: FloatArray) -> FloatArray:
    """Return points (N, 3) of glTF, with y up, in the coordinates of courses, with z up."""
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)


def z_up_to_y_up(points: FloatArray) -> FloatArray:
    """Return points (N, 3) with z up in the coordinates of glTF, with y up."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
