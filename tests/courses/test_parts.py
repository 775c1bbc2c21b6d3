"""Geometry of parts: areas, volumes and heights compared with formulas, positions and directions with geometry."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import trimesh
from trimesh import Trimesh

from minigolf_env.courses import Course, CourseError, Cup, load_course
from minigolf_env.courses.builder import CourseBuilder
from minigolf_env.courses.course import CUP_LINER_THICKNESS
from minigolf_env.courses.geometry.cup import build_cup_liner, cup_outline, cut_cup_into_mesh
from minigolf_env.courses.geometry.outlines import build_outline
from minigolf_env.courses.geometry.parts import build_inline_mesh
from minigolf_env.courses.geometry.solids import build_loop_track, circle_polygon, extrude, revolve, sweep_along_line
from minigolf_env.courses.geometry.terrain import build_terrain, make_height_function
from minigolf_env.courses.io.glb_course import to_glb
from minigolf_env.courses.io.gltf_scene import SceneObject
from minigolf_env.courses.io.gltf_writer import write_scene
from minigolf_env.courses.schema.heights import DirectionalHeight, RadialHeight, WaveHeight
from minigolf_env.courses.schema.limits import Limits
from minigolf_env.courses.schema.shapes import ArcCorner, OutlineShape

UNIT_SQUARE = shapely.box(0, 0, 1, 1)
LANE_OUTLINE = [{"box": (0, 0, 3, 1)}]


def shape(**fields: Any) -> OutlineShape:
    """Return a shape of an outline."""
    return OutlineShape.model_validate(fields)


def polygon_area_ratio(sides: int) -> float:
    """Return the area of the regular polygon around the unit circle, divided by pi."""
    return sides / math.pi * math.tan(math.pi / sides)


def test_outline_areas_match_formulas() -> None:
    """Boxes, circles, strips and polygons have their areas, rotated, rounded, joined and with holes."""
    box = build_outline([shape(box=(1, 2, 4, 4), turn=90)])
    assert box.bounds == pytest.approx((1.5, 1.5, 3.5, 4.5)) and box.area == pytest.approx(6.0)
    tilted = build_outline([shape(box=(1, 2, 4, 4), turn=30)])
    assert np.allclose(tilted.centroid.coords, (2.5, 3.0)) and tilted.area == pytest.approx(6.0)
    assert tilted.contains(shapely.Point(2.5 + 1.4 * math.cos(math.pi / 6), 3.0 + 1.4 * math.sin(math.pi / 6)))
    rounded = build_outline([shape(box=(0, 0, 3, 2), round=0.5)])
    assert rounded.area == pytest.approx(6.0 - (4.0 - math.pi) * 0.25, abs=2e-3)
    assert rounded.bounds == pytest.approx((0, 0, 3, 2))
    circle = build_outline([shape(circle=(1, 2, 0.5))])
    assert circle.area == pytest.approx(0.25 * math.pi * polygon_area_ratio(64)) and np.allclose(
        circle.centroid.coords, (1, 2)
    )
    strip = build_outline([shape(line=[(0, 0), (3, 4)], width=0.2)])
    assert strip.area == pytest.approx(1.0)
    elbow = build_outline([shape(line=[(0, 0), (2, 0), (2, 2)], width=0.2)])
    assert elbow.area == pytest.approx(0.8) and elbow.bounds == pytest.approx((0, -0.1, 2.1, 2))
    both = build_outline([shape(box=(0, 0, 2, 1)), shape(box=(1, 0, 3, 1))], [shape(box=(0.5, 0.2, 1.0, 0.7))])
    assert both.area == pytest.approx(2.75) and len(both.interiors) == 1


@pytest.mark.parametrize("seed", range(8))
def test_arc_points_lie_on_circle_through_three_points(seed: int) -> None:
    """Arcs in both directions and of any angle are on the circle; no segment turns by more than 5 degrees."""
    rng = np.random.default_rng(seed)
    middle, radius = rng.uniform(-2, 2, 2), rng.uniform(0.3, 2)
    arc_angle = rng.choice([-1, 1]) * rng.uniform(0.3, 5.5)
    first = rng.uniform(0, 2 * math.pi)
    over = first + arc_angle * rng.uniform(0.2, 0.8)

    def at(angle: float) -> tuple[float, float]:
        return middle[0] + radius * math.cos(angle), middle[1] + radius * math.sin(angle)

    corners = [tuple(middle), at(first), ArcCorner(via=at(over), to=at(first + arc_angle))]
    area = build_outline([OutlineShape(polygon=tuple(corners))])
    ring = np.array(area.exterior.coords)
    arc = ring[np.linalg.norm(ring - middle, axis=1) > 0.1 * radius]
    assert np.linalg.norm(arc - middle, axis=1) == pytest.approx(np.full(len(arc), radius))
    assert len(arc) == 1 + max(2, math.ceil(abs(math.degrees(arc_angle)) / 5.0 - 1e-9))
    piece = arc_angle / (len(arc) - 1)
    assert abs(math.degrees(piece)) <= 5.0 + 1e-9
    assert area.area == pytest.approx(abs(math.sin(piece)) * radius**2 / 2.0 * (len(arc) - 1))
    with pytest.raises(CourseError, match="arc: expected three points of a circle"):
        build_outline([OutlineShape(polygon=((0, 1), (0, 0), ArcCorner(via=(1, 0), to=(2, 0))))])


def test_rejects_invalid_outlines() -> None:
    """Outlines that are empty, in two pieces or cross themselves are errors."""
    for shapes, holes, message in (
        ([shape(box=(0, 0, 1, 1))], [shape(box=(-1, -1, 2, 2))], "expected one connected area"),
        ([shape(box=(0, 0, 1, 1)), shape(box=(2, 0, 3, 1))], [], "expected one connected area, received MultiPolygon"),
        ([shape(polygon=[(0, 0), (1, 1), (1, 0), (0, 1)])], [], "expected a simple shape.* Self-intersection"),
        ([shape(box=(0, 0, 1, 1), round=0.6)], [], "expected a simple shape"),
    ):
        with pytest.raises(CourseError, match=message):
            build_outline(shapes, holes)


def test_solid_volumes_match_formulas() -> None:
    """Solids are closed, wound outwards, between their levels and around their axis."""
    block = extrude(UNIT_SQUARE, -0.2, 0.3)
    assert block.volume == pytest.approx(0.5) and np.allclose(block.bounds, [[0, 0, -0.2], [1, 1, 0.3]])
    for sides in (5, 64):
        cone = revolve([(0.0, 1.0), (0.5, 1.0), (0.0, 2.0)], (2.0, 3.0), sides)
        assert cone.volume == pytest.approx(math.pi * 0.25 / 3.0 * polygon_area_ratio(sides))
        assert np.allclose(cone.center_mass, (2.0, 3.0, 1.25)) and cone.is_watertight
        ring = circle_polygon((2.0, 3.0), 0.5, sides)
        assert (
            ring.exterior.distance(shapely.Point(2, 3)) == pytest.approx(0.5) and len(ring.exterior.coords) == sides + 1
        )
    cup = Cup((1.0, 2.0, 0.5), 0.05, 0.1)
    liner = build_cup_liner(cup)
    area = math.pi * polygon_area_ratio(64)
    outer = (cup.radius + CUP_LINER_THICKNESS) ** 2 * (cup.depth + CUP_LINER_THICKNESS)
    assert liner.volume == pytest.approx(area * (outer - cup.radius**2 * cup.depth)) and liner.is_watertight
    assert liner.bounds[:, 2] == pytest.approx((0.5 - 0.1 - CUP_LINER_THICKNESS, 0.5))


@pytest.mark.parametrize(
    ("start", "end"), [((0, 0, 0), (2, 0, 0)), ((1, 2, 0.5), (0, 4, 1.0)), ((0, 0, 1), (0, -3, 0))]
)
def test_prism_extends_from_start_to_end_with_left_and_up_kept(
    start: tuple[float, ...], end: tuple[float, ...]
) -> None:
    """The profile's left is the left of the direction of travel seen from above, and its up is up."""
    delta = np.subtract(end, start)
    solid = sweep_along_line(shapely.box(0.0, 0.0, 0.1, 0.4), start, end)
    assert solid.is_watertight and solid.volume == pytest.approx(0.04 * np.linalg.norm(delta))
    left = np.array([-delta[1], delta[0], 0.0]) / np.hypot(*delta[:2])
    forward = delta / np.linalg.norm(delta)
    up = np.cross(forward, left)
    assert up[2] > 0.0
    offset = solid.vertices - start
    assert (offset @ left).min() == pytest.approx(0.0, abs=1e-12) and (offset @ left).max() == pytest.approx(0.1)
    assert (offset @ up).min() == pytest.approx(0.0, abs=1e-12) and (offset @ up).max() == pytest.approx(0.4)
    assert (offset @ forward).max() == pytest.approx(np.linalg.norm(delta))
    with pytest.raises(CourseError, match="expected a line that is not upright"):
        sweep_along_line(UNIT_SQUARE, start, np.add(start, (0, 0, 1)))


def test_loop_turns_over_once() -> None:
    """It touches the floor at both ends, comes down on the left, and its inner surface has its radius."""
    solid = build_loop_track(0.3, 0.2, 0.5, 0.06, 0.03, 64)
    assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0.0
    section = 0.26 * 0.03 + 2 * 0.03 * 0.06
    assert solid.volume == pytest.approx(section * 2 * math.pi * 0.3, rel=0.05)
    assert solid.bounds[:, 2] == pytest.approx((-0.03, 0.63), abs=1e-3)
    assert solid.bounds[:, 1] == pytest.approx((-0.13, 0.63)) and solid.bounds[:, 0] == pytest.approx(
        (-0.33, 0.33), abs=1e-3
    )
    ends = solid.vertices[[5, 6, -2, -3]]
    assert ends[:, [0, 2]] == pytest.approx(np.zeros((4, 2)), abs=1e-12)
    assert sorted(ends[:, 1]) == pytest.approx([-0.1, 0.1, 0.4, 0.6])
    around = np.hypot(solid.vertices[:, 0], solid.vertices[:, 2] - 0.3)
    assert around.max() == pytest.approx(0.33) and around.min() == pytest.approx(0.24)
    left = solid.vertices.reshape(65, 8, 3)[:, :, 1].mean(axis=1)
    assert (np.diff(left) >= 0.0).all() and left[32] == pytest.approx(0.25)


def test_cup_error_states_largest_radius_that_fits() -> None:
    """The stated radius fits, a larger one does not."""
    hole = cup_outline(UNIT_SQUARE, Cup((0.5, 0.4, 0.0), 0.1))
    assert hole.exterior.distance(shapely.Point(0.5, 0.4)) == pytest.approx(0.1 + CUP_LINER_THICKNESS)
    with pytest.raises(CourseError, match=r"cup radius: expected less than (0\.\d+) m") as raised:
        cup_outline(UNIT_SQUARE, Cup((0.5, 0.4, 0.0), 0.5))
    largest = float(str(raised.value).split("less than ")[1].split(" m")[0])
    assert cup_outline(UNIT_SQUARE, Cup((0.5, 0.4, 0.0), largest - 0.001)) and largest == pytest.approx(0.4, abs=0.005)
    with pytest.raises(CourseError, match="less than"):
        cup_outline(UNIT_SQUARE, Cup((0.5, 0.4, 0.0), largest + 0.001))
    with pytest.raises(CourseError, match="cup position: expected a place on one piece of floor"):
        cup_outline(UNIT_SQUARE, Cup((1.5, 0.4, 0.0), 0.1))


SAMPLE_POINTS = np.random.default_rng(0).uniform(-3.0, 3.0, (200, 2))
SAMPLE_POINTS = np.concatenate([SAMPLE_POINTS, SAMPLE_POINTS / 20.0])


def test_height_functions_match_profiles() -> None:
    """Heights along a direction, around a centre and of waves are added to the level and to each other."""
    profile = ((-1.0, 0.1), (0.5, 0.4), (2.0, -0.2))
    distance = np.cos(np.radians(30)) * (SAMPLE_POINTS[:, 0] - 0.5) + np.sin(np.radians(30)) * (
        SAMPLE_POINTS[:, 1] - 0.2
    )
    along = DirectionalHeight(at=(0.5, 0.2), turn=30, profile=profile)
    slope = np.interp(distance, *np.transpose(profile))
    assert make_height_function(0.0, [along])(SAMPLE_POINTS) == pytest.approx(slope)
    away = np.hypot(SAMPLE_POINTS[:, 0] - 1.0, SAMPLE_POINTS[:, 1] + 1.0)
    hill = RadialHeight(at=(1.0, -1.0), profile=((0.0, 0.5), (1.5, 0.0)))
    cone = np.interp(away, [0.0, 1.5], [0.5, 0.0])
    assert make_height_function(0.3, [along, hill])(SAMPLE_POINTS) == pytest.approx(0.3 + slope + cone)
    waves = WaveHeight(at=(0.5, 0.2), turn=30, amplitude=0.2, length=0.7, level=((0.0, 0.0, 0.5, 1.0),))
    z = make_height_function(0.0, [waves])(SAMPLE_POINTS)
    middle = np.hypot(*SAMPLE_POINTS.T)
    whole = 0.2 * np.sin(2.0 * np.pi * distance / 0.7)
    assert z[middle >= 1.0] == pytest.approx(whole[middle >= 1.0]) and (z[middle <= 0.5] == 0.0).all()
    fraction = np.clip((middle - 0.5) / 0.5, 0.0, 1.0)
    assert z == pytest.approx(whole * fraction * fraction * (3.0 - 2.0 * fraction))


def test_rounded_profile_is_moving_average_of_polyline() -> None:
    """Straight lines stay straight; a corner becomes a parabola that meets both sides."""
    profile = ((0.0, 0.0), (1.0, 0.5), (2.5, -0.1))
    fine = np.linspace(-0.2, 0.2, 4001)
    for record, s in (
        (DirectionalHeight(profile=profile, rounding=0.2), SAMPLE_POINTS[:, 0]),
        (RadialHeight(at=(0, 0), profile=profile, rounding=0.2), np.hypot(*SAMPLE_POINTS.T)),
    ):
        line = np.interp(
            np.abs(s[:, None] + fine) if isinstance(record, RadialHeight) else s[:, None] + fine, *np.transpose(profile)
        )
        mean = ((line[:, 1:] + line[:, :-1]) / 2.0).mean(axis=1)
        assert make_height_function(0.0, [record])(SAMPLE_POINTS) == pytest.approx(mean, abs=1e-6)
    wide = DirectionalHeight(profile=((-9.0, 0.0), (0.0, 0.9), (9.0, 0.0)), rounding=3.0)
    assert make_height_function(0.0, [wide])(
        np.array([[0.0, 0.0], [6.5, 0.0], [9.0, 0.0], [20.0, 0.0]])
    ) == pytest.approx([0.75, 0.25 + 0.0125 / 6.0, 0.075, 0.0])
    far = np.array([[-50.0, 0.0], [50.0, 0.0]])
    assert make_height_function(0.0, [DirectionalHeight(profile=profile, rounding=0.2)])(far) == pytest.approx(
        [0.0, -0.1]
    )


@pytest.mark.parametrize("holes", [[], [shapely.box(0.8, 0.4, 1.3, 0.7), shapely.Point(2.0, 0.5).buffer(0.2)]])
def test_terrain_fills_space_between_bottom_and_heights(holes: list[Any]) -> None:
    """It is closed, its top follows the heights and covers the area once, and its volume is the space below."""
    area = shapely.box(0, 0, 3, 1)
    for hole in holes:
        area = area - hole
    height = make_height_function(0.2, [DirectionalHeight(profile=((0.0, 0.0), (3.0, 0.3)))])
    solid = build_terrain(area, height, (0.11, 0.07), -0.1)
    assert solid.is_watertight and solid.is_winding_consistent
    up = solid.face_normals[:, 2] > 1e-6
    corners = solid.triangles[up]
    face_areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2.0
    assert face_areas.sum() == pytest.approx(area.area) and (face_areas > 0.0).all()
    assert corners[:, :, 2].ravel() == pytest.approx(height(corners[:, :, :2].reshape(-1, 2)))
    middle = np.array(area.centroid.coords)
    assert solid.volume == pytest.approx(area.area * (float(height(middle)[0]) + 0.1))
    assert (
        solid.bounds[0, 2] == pytest.approx(-0.1)
        and (np.abs(solid.face_normals[~up, 2] * (solid.face_normals[~up, 2] + 1)) < 1e-9).all()
    )
    sides = np.ptp(corners[:, :, :2], axis=1)
    assert (sides[:, 0] <= 0.11 * 2.1).all() and (sides[:, 1] <= 0.07 * 2.1).all()
    assert np.mean((sides[:, 0] <= 0.11 + 1e-9) & (sides[:, 1] <= 0.07 + 1e-9)) > 0.5
    with pytest.raises(CourseError, match=r"heights: expected all above the bottom at 0\.2 m"):
        build_terrain(area, height, (0.1, 0.1), 0.2)


def test_cutting_cup_into_mesh_removes_pocket_volume() -> None:
    """The rest of the floor stays; obstacles in the way and thin floors are errors."""
    floor = extrude(shapely.box(0, 0, 2, 1), -0.2, 0.0)
    cup = Cup((0.7, 0.4, 0.0), 0.06, 0.1)
    cut = cut_cup_into_mesh(floor, cup, [])
    pocket = math.pi * polygon_area_ratio(64) * (0.06 + CUP_LINER_THICKNESS) ** 2 * (0.1 + CUP_LINER_THICKNESS)
    assert cut.is_watertight and cut.is_winding_consistent and cut.volume == pytest.approx(0.4 - pocket)
    assert np.allclose(cut.bounds, floor.bounds)
    with pytest.raises(CourseError, match="cup position: expected a place on one piece of floor"):
        cut_cup_into_mesh(floor, cup, [shapely.box(0.6, 0.3, 0.8, 0.5)])
    with pytest.raises(CourseError, match="cup radius: expected less than"):
        cut_cup_into_mesh(floor, cup, [shapely.box(0.74, 0.0, 0.8, 1.0)])
    with pytest.raises(CourseError, match=r"cup depth: expected a floor thicker than 0.103 m"):
        cut_cup_into_mesh(extrude(shapely.box(0, 0, 2, 1), -0.1, 0.0), cup, [])
    thin, foot = extrude(shapely.box(0, 0, 2, 1), -0.1, 0.0), extrude(shapely.box(3, 0, 4, 1), -1.0, 0.0)
    with pytest.raises(CourseError, match=r"received one that ends at z = -0\.1 m"):
        cut_cup_into_mesh(trimesh.util.concatenate([thin, foot]), cup, [])
    with pytest.raises(CourseError, match="cup position"):
        cut_cup_into_mesh(floor, Cup((0.7, 0.4, 0.01), 0.06), [])


def part_mesh(**part: Any) -> Trimesh:
    """Return the mesh of a part next to a lane."""
    mesh = CourseBuilder("one", tee=(0.3, 0.5)).add("lane", outline=LANE_OUTLINE).add(**part).course().parts[-1].mesh
    return Trimesh(mesh.vertices, mesh.faces)


def test_parts_are_rotated_then_moved() -> None:
    """Rotation is counter-clockwise seen from above, about the origin of the part."""
    box = part_mesh(kind="box", at=(1.5, 0.5, 0.2), size=(0.4, 0.2, 0.1), turn=90)
    assert np.allclose(box.bounds, [[1.4, 0.3, 0.15], [1.6, 0.7, 0.25]])
    tilted = part_mesh(kind="box", at=(1.5, 0.5, 0.2), size=(0.4, 0.2, 0.1), turn=30)
    tip = np.array([0.2, 0.1]) @ [
        [math.cos(math.pi / 6), math.sin(math.pi / 6)],
        [-math.sin(math.pi / 6), math.cos(math.pi / 6)],
    ]
    assert np.hypot(*(tilted.vertices[:, :2] - [1.5, 0.5] - tip).T).min() < 1e-9
    ball = part_mesh(kind="sphere", at=(1.5, 0.5, 0.3), radius=0.2)
    assert np.linalg.norm(ball.vertices - [1.5, 0.5, 0.3], axis=1) == pytest.approx(np.full(len(ball.vertices), 0.2))


def test_builder_accepts_cup_record_and_mesh_folder(tmp_path: Path) -> None:
    """A builder takes a cup as a table and a folder of mesh files; errors name the course."""
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "stone.obj")
    builder = CourseBuilder("own", tee=(0.3, 0.5), cup={"position": (2.5, 0.5, 0.0), "radius": 0.06, "depth": 0.09})
    builder.add("lane", outline=LANE_OUTLINE).add("mesh", file="stone.obj", at=(1.5, 0.5, 0.1))
    course = builder.course(tmp_path)
    assert course.cup == Cup((2.5, 0.5, 0.0), 0.06, 0.09) and len(course.parts) == 4
    with pytest.raises(CourseError, match="own: parts"):
        builder.add("lane", outlines=LANE_OUTLINE).description()


def test_default_bounds_enclose_lanes_with_borders() -> None:
    """Bounds are from 0.3 m below to 2 m above the floors, or around all meshes if there is no lane."""
    builder = CourseBuilder("two", tee=(0.3, 0.5)).add("lane", outline=LANE_OUTLINE, border=0.1)
    builder.add("lane", outline=[{"box": (3.5, 0, 4.5, 1)}], level=0.5, border=0.2)
    assert np.allclose(builder.course().bounds, [(-0.1, -0.2, -0.3), (4.7, 1.2, 2.5)])
    diamond = CourseBuilder("tip", tee=(0, 0)).add(
        "lane", outline=[{"polygon": [(1, 0), (0, 1), (-1, 0), (0, -1)]}], border=0.1
    )
    reach = 1.0 + 0.1 * math.sqrt(2.0)  # Borders have mitred corners.
    assert np.allclose(diamond.course().bounds, [(-reach, -reach, -0.3), (reach, reach, 2.0)])
    solid = CourseBuilder("mesh", tee=(0.0, 0.0)).add("box", at=(0, 0, -0.1), size=(2, 1, 0.2)).course()
    assert np.allclose(solid.bounds, [(-1, -0.5, -0.5), (1, 0.5, 2.0)])


@pytest.mark.parametrize(
    "part",
    [
        {"kind": "block", "outline": [{"box": (2.4, 0.4, 2.6, 0.6)}]},
        {"kind": "cylinder", "at": (2.5, 0.5, -0.05), "radius": 0.1, "height": 0.2},
        {"kind": "revolved", "at": (2.5, 0.5), "profile": [(0, -0.05), (0.1, -0.05), (0.0, 0.2)]},
    ],
)
def test_rejects_cup_under_obstacle(part: dict[str, Any]) -> None:
    """An obstacle that the cup would cut into is an error; a block that ends below the floor is not."""
    for x, message in ((2.5, "cup position"), (2.36, "cup radius: expected less than"), (2.2, "")):
        builder = CourseBuilder("post", tee=(0.4, 0.5), cup=(x, 0.5, 0.0)).add("lane", outline=LANE_OUTLINE).add(**part)
        if message:
            with pytest.raises(CourseError, match=message):
                builder.course()
        else:
            assert [one.name for one in builder.course().parts][:2] == ["floor", "cup"]
    ring = {"kind": "block", "outline": [{"box": (2.2, 0.2, 2.8, 0.8)}], "holes": [{"box": (2.3, 0.3, 2.7, 0.7)}]}
    assert (
        CourseBuilder("ring", tee=(0.4, 0.5), cup=(2.5, 0.5, 0.0))
        .add("lane", outline=LANE_OUTLINE)
        .add(**ring)
        .course()
        .cup
    )
    low = {"kind": "block", "outline": [{"box": (2.4, 0.4, 2.6, 0.6)}], "bottom": -0.6, "top": -0.3}
    assert (
        CourseBuilder("low", tee=(0.4, 0.5), cup=(2.5, 0.5, 0.0))
        .add("lane", outline=LANE_OUTLINE)
        .add(**low)
        .course()
        .cup
    )


def test_part_appearance_overrides_that_of_its_surface() -> None:
    """Hexadecimal colours become fractions of 255; a border has a separate colour."""
    builder = CourseBuilder("red", tee=(0.3, 0.5)).surface("rubber", damping=0.9, material="stone", color="#102030")
    builder.add("lane", outline=LANE_OUTLINE, border_color="#ff8000", name="way")
    builder.add("box", at=(1, 0.5, 0.1), size=(0.1, 0.1, 0.2), surface="rubber")
    builder.add(
        "box", at=(2, 0.5, 0.1), size=(0.1, 0.1, 0.2), surface="rubber", material="brick", color="#ffffff", name="b"
    )
    appearances = {part.name: (part.material, part.color, part.mesh.surface.damping) for part in builder.course().parts}
    assert appearances["way border"] == ("wood", (1.0, 128 / 255, 0.0), 0.7)
    assert appearances["box 2"] == ("stone", (16 / 255, 32 / 255, 48 / 255), 0.9) and appearances["b"] == (
        "brick",
        (1.0, 1.0, 1.0),
        0.9,
    )
    assert appearances["way floor"][:2] == ("felt", None)


def test_inline_mesh_is_validated() -> None:
    """Indices must be those of vertices, coordinates within a kilometre, and there must be a face."""
    from minigolf_env.courses.schema.parts import MeshPart

    box = trimesh.creation.box((1, 1, 1))
    good = MeshPart(vertices=box.vertices.tolist(), faces=box.faces.tolist())
    assert build_inline_mesh(good, Limits()).volume == pytest.approx(1.0) and build_inline_mesh(
        good, Limits(triangles=12)
    )
    for change, message in (
        ({"faces": ()}, "at least one face"),
        ({"vertices": ((0, 0, 0), (1001, 0, 0), (0, 1, 0)), "faces": ((0, 1, 2),)}, "within 1000 m"),
        ({"vertices": ((0, 0, 0), (math.nan, 0, 0), (0, 1, 0)), "faces": ((0, 1, 2),)}, "finite"),
        ({"vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0)), "faces": ((0, 1, 3),)}, "expected rows 0 to 2"),
        ({"vertices": ((0, 0, 0), (1, 0, 0), (0, 1, 0)), "faces": ((0, 1, -1),)}, "expected rows 0 to 2"),
    ):
        with pytest.raises(CourseError, match=message):
            build_inline_mesh(good.model_copy(update=change), Limits())
    assert build_inline_mesh(MeshPart(vertices=((0, 0, 0), (1000, 0, 0), (0, 1, 0)), faces=((0, 1, 2),)), Limits())
    with pytest.raises(CourseError, match="at most 11 triangles"):
        build_inline_mesh(good, Limits(triangles=11))


def test_limits_are_inclusive() -> None:
    """A size at the limit is accepted, a larger one is an error."""
    limits = Limits(file_bytes=100, text_bytes=10, triangles=5, cells=30)
    limits.check_triangles(5)
    limits.check_bytes("file", 100)
    limits.check_bytes("file", 10, text=True)
    for refused in (
        lambda: limits.check_triangles(6),
        lambda: limits.check_bytes("file", 101),
        lambda: limits.check_bytes("file", 11, text=True),
    ):
        with pytest.raises(CourseError, match="expected at most"):
            refused()
    # The limit counts the cells, and the narrow triangles of the seam around them.
    for box, cell, size, largest in (((1, 1, 7, 4), (1, 1), "6 x 3", 18 + 18), ((1, 1, 7, 4), (2, 1), "3 x 3", 9 + 24)):
        Limits(cells=largest).check_cells(box, cell)
        with pytest.raises(CourseError, match=f"at most {largest - 1} cells, received {size}"):
            Limits(cells=largest - 1).check_cells(box, cell)
    with pytest.raises(CourseError, match="received 6 x inf"):
        Limits().check_cells((1, 1, 7, 4), (1, 1e-320))
    for text, name in ((False, "file_bytes"), (True, "text_bytes")):
        with pytest.raises(CourseError, match=rf"load it with limits=Limits\({name}=\.\.\.\)"):
            limits.check_bytes("file", 101, text)


TUNNEL_PART = {"kind": "tunnel", "start": (1, 0.5), "end": (2, 0.5), "height": 0.4, "roof": 0.2}
"""Tunnel without the keys that its door is compared with."""


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ({"kind": "ramp", "start": (1, 0.5), "end": (1, 0.5), "width": 0.4, "height": 0.1}, "other than the start"),
        ({**TUNNEL_PART, "width": 0.6, "door": 0.4}, "door: expected less than the width and the height"),
        ({**TUNNEL_PART, "width": 0.2, "door": 0.2}, "door: expected less than the width and the height"),
        ({"kind": "mesh", "file": "far.obj"}, "expected corners within 1000 m"),
        ({"kind": "mesh", "file": "none.glb"}, "file 'none.glb': expected triangles, received none"),
    ],
)
def test_error_says_why_part_cannot_be_built(part: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Ramps without length, doors wider than their house, meshes far away or without triangles are errors."""
    trimesh.creation.box((1, 1, 1), np.diag([1, 1, 1, 1]) + 2000.0 * np.eye(4, k=3)).export(tmp_path / "far.obj")
    (tmp_path / "none.glb").write_bytes(write_scene([SceneObject("nothing", (0.0, 0.0, 0.0), {}, None, None)], {}))
    with pytest.raises(CourseError, match=f"part '.* 2': .*{message}"):
        CourseBuilder("one", tee=(0.3, 0.5)).add("lane", outline=LANE_OUTLINE).add(**part).course(tmp_path)


@pytest.mark.parametrize("turn", [0, 90, 180, -90])
def test_lane_with_heights_has_its_thickness_below_lowest_point(turn: int) -> None:
    """The lowest point may be anywhere along the lane."""
    dip = [{"kind": "along", "at": (1.5, 0.5), "turn": turn, "profile": [(0.2, 0.0), (0.4, -0.2)]}]
    for level in (0.0, 0.3):
        lane = CourseBuilder("dip", tee=(1.5, 0.5)).add(
            "lane", outline=LANE_OUTLINE, heights=dip, level=level, thickness=0.15, border=0
        )
        assert lane.course().parts[0].mesh.vertices[:, 2].min() == pytest.approx(level - 0.2 - 0.15)


def test_part_named_like_tee_is_renamed_in_glb(tmp_path: Path) -> None:
    """In the file the part's name begins with "part", and only the tee is read as the tee."""
    builder = CourseBuilder("one", tee=(0.3, 0.5)).add("lane", outline=LANE_OUTLINE)
    builder.add("box", name="Tee post", at=(1.5, 0.5, 0.1), size=(0.1, 0.1, 0.3))
    (tmp_path / "one.glb").write_bytes(to_glb(builder.course()))
    again = load_course(tmp_path / "one.glb")
    assert again.tee == builder.course().tee and again.parts[-1].name == "part Tee post"


@pytest.mark.parametrize("side", [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)])
def test_cup_needs_level_ground_at_centre_and_sides(side: tuple[int, int]) -> None:
    """The ground may have any level, but no bump in the cup's centre or on a side of its wall."""
    x, y = (at + (Cup.radius + CUP_LINER_THICKNESS) * delta for at, delta in zip((1.5, 0.5), side, strict=True))

    def course(up: float) -> Course:
        bump = {"kind": "radial", "at": (x, y), "profile": [(0, up), (0.5 * CUP_LINER_THICKNESS, 0)]}
        builder = CourseBuilder("bump", tee={"at": (0.4, 0.5), "height": 0.3}, cup=(1.5, 0.5, 0.3), par=2)
        return builder.add("lane", outline=LANE_OUTLINE, level=0.3, heights=[bump]).course()

    assert course(0.0).cup is not None
    with pytest.raises(CourseError, match="cup: position: expected a place on a lane or a floor, at its level"):
        course(0.001)
