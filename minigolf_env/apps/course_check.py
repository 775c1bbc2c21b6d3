"""The bundled holes in a table and in pictures, and what is wrong with a hole one has made."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from minigolf_env._atomic_io import atomic_write
from minigolf_env._validation import one_of
from minigolf_env.courses import Course, CourseError, Cup, list_courses, load_course
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.physics import World
from minigolf_env.players.search import search
from minigolf_env.rendering import static_view

CUPLESS = "room"
"""The bundled course without a cup."""

MOST_STROKES = 10
"""Within so many, search has to hole out."""

COLUMNS = 3
"""Pictures in a row of the contact sheet."""


def table() -> str:
    """Return a line for each bundled course: name, par, size and triangles."""
    rows = [("course", "par", "size", "triangles", "")]
    for name in [*list_courses(), CUPLESS]:
        course = load_course(name)
        lower, upper = extent(course)
        size = " x ".join(f"{side:.1f}" for side in (upper - lower)[:2].tolist())
        par = "-" if course.par is None else str(course.par)
        rows.append((name, par, f"{size} m", f"{triangles(course):,}", about(name)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        f"{row[0]:<{widths[0]}}  {row[1]:>{widths[1]}}  {row[2]:>{widths[2]}}  {row[3]:>{widths[3]}}  {row[4]}".rstrip()
        for row in rows
    )


def about(name: str) -> str:
    """Return the sentence about a bundled course."""
    from minigolf_env.courses.io.toml_course import read_description
    from minigolf_env.courses.library import DATA_DIR

    return read_description(DATA_DIR / f"{name}.toml").about


def triangles(course: Course) -> int:
    """Return how many triangles a course has."""
    return sum(len(part.mesh.faces) for part in course.parts)


def extent(course: Course) -> NDArray[np.float64]:
    """Return the lower and upper corner (2, 3) of the box around a course, m."""
    points = np.concatenate([part.mesh.vertices for part in course.parts])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def picture(course: Course, camera: str = "tee", size: tuple[int, int] = (640, 480)) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) of a course with the ball on its tee.

    Raises:
        RenderingError: nothing can be drawn here.
    """
    from minigolf_env.rendering.gl.offscreen import draw

    ball = np.array([*course.tee.centre, course.tee.height + course.ball_radius])
    return draw(course, *static_view(course, camera, size[0] / size[1], ball), size)


def write_pictures(folder: Path) -> Path:
    """Write a picture of each bundled course, and all of them on one sheet; return the sheet's path."""
    import matplotlib.image
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    names = [*list_courses(), CUPLESS]
    rows = -(-len(names) // COLUMNS)
    sheet = Figure(figsize=(5.0 * COLUMNS, 4.05 * rows), layout="constrained")
    drawn = tqdm(names, "Drawing", leave=False, disable=None)
    for axes, name in itertools.zip_longest(sheet.subplots(rows, COLUMNS).flat, drawn):
        axes.axis("off")
        if name is not None:
            course = load_course(name)
            shot = picture(course, "orbit")
            with atomic_write(folder / f"{name}.png") as part:
                matplotlib.image.imsave(part, shot)
            axes.imshow(shot)
            axes.set_title(name if course.par is None else f"{name}, par {course.par}", fontsize=16)
    with atomic_write(folder / "courses.png") as part:
        sheet.savefig(part, dpi=60)
    return folder / "courses.png"


def write_preview(course: Course, path: Path) -> None:
    """Write a picture of a course from behind the tee, from above and from a side, and its folder.

    Raises:
        ValueError: it is to be another file than .png, .jpg or .webp; nothing was drawn then.
        OSError: it cannot be written.
    """
    import matplotlib.image

    one_of(path.suffix.lower(), (".png", ".jpg", ".webp"), "preview: the file's ending")
    with atomic_write(path) as part:
        views = [picture(course, camera, (480, 480)) for camera in ("tee", "top", "orbit")]
        matplotlib.image.imsave(part, np.concatenate(views, axis=1))


def check(path: str | Path | Course) -> Iterator[str]:
    """Yield what is wrong with a hole: a sentence a fault; nothing if it can be played.

    Args:
        path: a course file, a bundled course's name, or a Course.
    """
    try:
        course = load_course(path)
        world = course.world()
    except CourseError as error:
        yield str(error)
        return
    yield from _places(course, world)
    if course.cup is not None:
        yield from _play(course, world)


def _places(course: Course, world: World) -> Iterator[str]:
    """Yield what is wrong with the places of tee and cup."""
    lowest = extent(course)[0, 2] - 1.0
    lower, upper = course.tee.lower, course.tee.upper
    for x, y in sorted({*itertools.product(*zip(lower, upper, strict=True)), course.tee.centre}):
        hit = world.sweep((x, y, course.tee.height + course.ball_radius), (x, y, lowest))
        if not hit.hit:
            yield f"tee: expected a floor below ({x:g}, {y:g}), received none; move the tee over a floor."
            return
    if course.cup is None:
        return
    yield from _cup(course.cup, world)
    x, y, rim = course.cup.position
    around = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = np.array([x, y, 0.0]) + 1.5 * course.cup.radius * np.c_[np.cos(around), np.sin(around), 0.0 * around]
    above, below = (np.array([0.0, 0.0, z]) for z in (rim + 2.0 * course.ball_radius, lowest))
    hits = world.sweep_batch(ring + above, ring + below)
    if not np.all(hits.hit):
        yield f"cup: expected a floor all around {course.cup.position}, received a gap beside it; move the cup."


def _cup(cup: Cup, world: World) -> Iterator[str]:
    """Yield what is wrong with the way down into the cup."""
    x, y, rim = cup.position
    over = rim + world.ball_radius
    try:
        world.check_collision_free((x, y, over))
    except ValueError as error:
        yield f"cup: expected free space over it; {error}"
        return
    bottom = rim - cup.depth
    hit = world.sweep((x, y, over), (x, y, bottom - 1.0))
    landed = rim + hit.alpha * (bottom - 1.0 - over)
    if not hit.hit or landed < bottom - 1e-6:
        yield f"cup: expected a bottom at z = {bottom:g} m below {cup.position}, received none; cut the cup."
    elif landed > bottom + 1e-6:
        yield (
            f"cup: expected a way down to its bottom at z = {bottom:g} m, received something at z = {landed:g} m; "
            "cut the cup, and put its position on the floor's level."
        )


def _play(course: Course, world: World) -> Iterator[str]:
    """Yield what playing the hole shows."""
    env = MiniGolfEnv(course=course, tee="fixed", max_strokes=MOST_STROKES)
    env.reset(seed=0)
    over, info = False, dict[str, Any]()
    while not over:
        _, _, over, _, info = env.step(search(env).action)
    if not info["is_success"]:
        yield (
            f"cup: expected search to hole out within {MOST_STROKES} strokes, received no such putts; "
            "open a way to the cup, or raise top_speed."
        )
    yield from _stuck(env)


def _stuck(env: MiniGolfEnv, putts: int = 400) -> Iterator[str]:
    """Yield places where random putts left the ball for good."""
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    first = env.what_if(_random(putts, rng))
    places: Any = np.unique(np.round(first.position[~first.holed], 6), axis=0)
    for place in places[rng.permutation(len(places))[:40]]:
        try:
            env.reset(options={"position": np.add(place, (0.0, 0.0, 1e-5))})
        except ValueError:
            continue
        tried = env.what_if(_random(48, rng))
        away = np.linalg.norm(tried.position - place, axis=1)
        if not tried.holed.any() and away.max() < 2.0 * env.task.course.ball_radius:
            yield f"lie: expected a way on from {place.round(3).tolist()}, received none in 48 putts; close that spot."
            return


def _random(n: int, rng: np.random.Generator) -> NDArray[np.float32]:
    angle, length = rng.uniform(-np.pi, np.pi, n), rng.uniform(0.1, 1.0, n)
    return np.asarray(np.c_[length * np.cos(angle), length * np.sin(angle)], dtype=np.float32)
