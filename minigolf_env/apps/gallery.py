"""The bundled courses as a table and as images, and a preview of any course."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from tqdm import tqdm

from minigolf_env._atomic_io import atomic_write, check_output
from minigolf_env._validation import one_of
from minigolf_env.courses import Course, list_courses, load_course
from minigolf_env.courses.io.toml_course import read_description
from minigolf_env.courses.library import DATA_DIR, ROOM_NAMES
from minigolf_env.rendering import static_view
from minigolf_env.rendering.gl.offscreen import draw

NUM_SHEET_COLUMNS = 3
"""Number of images in a row of the contact sheet."""

SHEET_NAME = "courses"
"""Name of the contact sheet, without ending."""

PREVIEW_ENDINGS = (".png", ".jpg", ".webp")
"""File endings of a preview."""


def course_table() -> Table:
    """Return a table with a row for each bundled course: name, par, size, triangles and description."""
    table = Table(box=None)
    for column in ("course", "par", "size", "triangles", "description"):
        table.add_column(column, justify="left" if column in ("course", "description") else "right")
    for name in [*list_courses(), *ROOM_NAMES]:
        course = load_course(name)
        vertices = np.concatenate([part.mesh.vertices for part in course.parts])
        size = " x ".join(f"{side:.1f}" for side in np.ptp(vertices, axis=0)[:2].tolist())
        par = "-" if course.par is None else str(course.par)
        num_triangles = sum(len(part.mesh.faces) for part in course.parts)
        description = read_description(DATA_DIR / f"{name}.toml").about
        table.add_row(name, par, f"{size} m", f"{num_triangles:,}", description)
    return table


def render_course(course: Course, camera: str = "tee", size: tuple[int, int] = (640, 480)) -> NDArray[np.uint8]:
    """Return an image (height, width, 3) of a course with the ball on its tee.

    Raises:
        RenderingError: there is no OpenGL.
    """
    ball = np.array([*course.tee.centre, course.tee.height + course.ball_radius])
    return draw(course, *static_view(course, camera, size[0] / size[1], ball), size)


def write_gallery(folder: Path) -> Path:
    """Write an image of each bundled course, and all of them on a contact sheet; return the path of the sheet.

    Raises:
        OSError: the files cannot be written; nothing was drawn then.
    """
    from matplotlib.figure import Figure
    from matplotlib.image import imsave

    names = [*list_courses(), *ROOM_NAMES]
    for name in [*names, SHEET_NAME]:
        check_output(folder / f"{name}.png", "pictures")
    num_rows = -(-len(names) // NUM_SHEET_COLUMNS)
    sheet = Figure(figsize=(5.0 * NUM_SHEET_COLUMNS, 4.05 * num_rows), layout="constrained")
    progress = tqdm(names, "Drawing", leave=False, disable=None)
    for axes, name in itertools.zip_longest(sheet.subplots(num_rows, NUM_SHEET_COLUMNS).flat, progress):
        axes.axis("off")
        if name is not None:
            course = load_course(name)
            image = render_course(course, "orbit")
            with atomic_write(folder / f"{name}.png") as temp_path:
                imsave(temp_path, image)
            axes.imshow(image)
            axes.set_title(name if course.par is None else f"{name}, par {course.par}", fontsize=16)
    sheet_path = folder / f"{SHEET_NAME}.png"
    with atomic_write(sheet_path) as temp_path:
        sheet.savefig(temp_path, dpi=60)
    return sheet_path


def write_preview(course: Course, path: Path) -> None:
    """Write an image of a course from behind the tee, from above and from a side. The folder is made.

    Raises:
        ValueError: the file ending is not one of ``PREVIEW_ENDINGS``; nothing was drawn then.
        OSError: the file cannot be written.
    """
    from matplotlib.image import imsave

    check_preview(path)
    with atomic_write(path) as temp_path:
        views = [render_course(course, camera, (480, 480)) for camera in ("tee", "top", "orbit")]
        imsave(temp_path, np.concatenate(views, axis=1))


def check_preview(path: Path) -> None:
    """Raise a ValueError or an OSError if no preview can be written to a file."""
    one_of(path.suffix.lower(), PREVIEW_ENDINGS, "preview: the file's ending")
    check_output(path, "preview")
