"""The commands of the command line. The docstring of a command is its help.

A command imports what it needs when it runs, so that ``minigolf --help`` is quick.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

from minigolf_env._validation import quote
from minigolf_env.evaluation import FIRST_EVALUATION_SEED

if TYPE_CHECKING:
    import tyro


def _import_lazily(name: str) -> ModuleType:
    """Return a module that is loaded on first use: see "Implementing lazy imports" in Python's documentation."""
    spec = importlib.util.find_spec(name)
    if name in sys.modules or spec is None or spec.loader is None:
        return importlib.import_module(name)
    spec.loader = importlib.util.LazyLoader(spec.loader)
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if not TYPE_CHECKING:
    tyro = _import_lazily("tyro")  # The list of commands does not need it, and would take twice as long with it.


def play(
    course: str = "dogleg",
    opponent: str | None = None,
    size: tuple[int, int] = (960, 600),
    profile: str = "auto",
    log: bool = False,
) -> None:
    """Play minigolf with the mouse or the keyboard.

    $ minigolf play
    $ minigolf play --course round --opponent ppo
    $ minigolf play --course my_hole.toml

    Args:
        course: a hole's name or file, "round" for a round of nine holes, or "room" to throw a ball in three dimensions.
        opponent: a policy to play against: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        size: width and height of the window, pixels.
        profile: rendering quality: "high", "fast" or "auto".
        log: print each event as a line of JSON, for other programs.
    """
    from minigolf_env.apps.play import run

    run(course, opponent=opponent, size=size, profile=profile, log=log)


def video(
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("putt.mp4"),
    course: str = "dogleg",
    difficulty: str | None = None,
    policy: str = "search",
    episodes: int = 1,
    seed: int = 0,
    camera: str = "follow",
    size: tuple[int, int] = (640, 480),
    fps: int = 30,
    profile: str = "high",
) -> None:
    """Record a video of a policy that plays a hole, a round, or levels.

    $ minigolf video -o putt.mp4
    $ minigolf video --policy ppo --camera top --size 1280 720
    $ minigolf video --course round --episodes 9 -o round.mp4
    $ minigolf video --course procedural --difficulty medium --policy generalist

    Args:
        output: the file to write, .mp4 or .gif.
        course: a hole's name or file, "round" for nine holes in turn, or "procedural" for levels.
        difficulty: difficulty of levels: easy, medium or hard.
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        episodes: number of episodes; 9 are a whole round.
        seed: seed of the environment and of the random policy.
        camera: "follow", "top", "tee" or "orbit".
        size: width and height, pixels.
        fps: frames per second.
        profile: rendering quality: "high" or "fast".
    """
    from minigolf_env.apps.record_policy import record_policy

    record_policy(
        output,
        course,
        policy,
        difficulty=difficulty,
        episodes=episodes,
        seed=seed,
        camera=camera,
        size=size,
        fps=fps,
        profile=profile,
    )


def courses(pictures: Path | None = None) -> None:
    """List the bundled courses: par, size, number of triangles, and a description.

    $ minigolf courses
    $ minigolf courses --pictures pictures

    Args:
        pictures: folder for an image of each course, and a contact sheet of all of them, courses.png.
    """
    from minigolf_env._atomic_io import check_output_folder
    from minigolf_env.apps.gallery import course_table, write_gallery
    from minigolf_env.evaluation.report import print_table

    if pictures is not None:
        check_output_folder(pictures, "pictures")
    print_table(course_table())
    if pictures is not None:
        print(f"wrote {write_gallery(pictures)}")


def check(file: Annotated[str, tyro.conf.Positional], preview: Path | None = None) -> None:
    """Check a hole of your own and print its errors; the exit code is 1 if it has any.

    $ minigolf check my_hole.toml
    $ minigolf check my_hole.glb --preview my_hole.png

    Args:
        file: a .toml or .glb file, or the name of a bundled course.
        preview: image file to write if the hole can be loaded: .png, .jpg or .webp.
    """
    from minigolf_env.apps.course_check import find_course_errors
    from minigolf_env.apps.gallery import check_preview, write_preview
    from minigolf_env.courses import load_course

    if preview is not None:
        check_preview(preview)
    course = load_course(file)
    errors = list(find_course_errors(course))
    for error in errors:
        print(error, file=sys.stderr)
    if preview is not None:
        write_preview(course, preview)
        print(f"wrote {preview}")
    if errors:
        sys.exit(1)
    print(f"{course.name}: no errors found.")


def map_(
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("map.png"),
    course: str = "dogleg",
    tee: Annotated[str | None, tyro.conf.arg(metavar="X,Y")] = None,
    directions: int = 720,
    speeds: int = 140,
) -> None:
    """Draw where putts in every direction and at every speed end, and which hole out.

    $ minigolf map
    $ minigolf map --course volcano --tee 0.3,0.6 -o volcano.png
    $ minigolf map --course my_hole.toml --directions 1440 --speeds 280

    Args:
        output: the image file to write.
        course: a hole's name or file.
        tee: position of the ball, m, such as 0.3,0.6; by default the middle of the tee.
        directions: number of directions.
        speeds: number of speeds.
    """
    from minigolf_env.apps.putt_map import write_map

    putts = write_map(output, course, None if tee is None else _parse_position(tee), directions, speeds, progress=True)
    print(f"wrote {output}: {putts.outcome.result.size:,} putts, {putts.outcome.holed.sum():,} holes in one")


def evaluate(
    policy: str = "search",
    course: str = "dogleg",
    difficulty: str | None = None,
    episodes: int = 100,
    first_seed: int = FIRST_EVALUATION_SEED,
    max_strokes: int = 10,
    putt_noise: tuple[float, float] = (0.0, 0.0),
    watch: bool = False,
    json: Path | None = None,
) -> None:
    """Evaluate a policy on a hole or on levels, with confidence intervals.

    $ minigolf evaluate --policy ppo
    $ minigolf evaluate --policy runs/dogleg-1/best.zip --json score.json
    $ minigolf evaluate --course procedural --difficulty medium --watch

    Args:
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        course: a hole's name or file, "round" for nine holes in turn, or "procedural" for levels.
        difficulty: difficulty of levels: easy, medium or hard.
        episodes: number of episodes.
        first_seed: seed of the first episode, and of a random policy; on levels, the number of the first level. Each
            further episode has the next number.
        max_strokes: largest number of strokes of an episode.
        putt_noise: standard deviations of direction (degrees) and speed (fraction of it).
        watch: show the putts in a window.
        json: also write the result to this file.
    """
    from dataclasses import asdict

    from minigolf_env._atomic_io import check_output
    from minigolf_env.evaluation.evaluate import evaluate as evaluate_policy
    from minigolf_env.evaluation.report import print_evaluations, write_json_report
    from minigolf_env.players.policies import load_policy

    if json is not None:
        check_output(json, "json")
    result = evaluate_policy(
        load_policy(policy, first_seed),
        policy,
        course,
        difficulty=difficulty,
        episodes=episodes,
        first_seed=first_seed,
        max_strokes=max_strokes,
        putt_noise=putt_noise,
        watch=watch,
    )
    print_evaluations([result])
    if json is not None:
        write_json_report(json, **asdict(result))


def benchmark(
    policy: str = "search",
    difficulty: tuple[str, ...] = ("easy", "medium", "hard"),
    levels: int = 200,
    max_strokes: int = 10,
    seed: int = 0,
    json: Path | None = None,
) -> None:
    """Evaluate a policy on training levels and held-out levels, relative to search.

    $ minigolf benchmark --policy random --difficulty easy --levels 20
    $ minigolf benchmark --policy runs/procedural-1/best.npz --json scores.json

    Args:
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        difficulty: difficulties of the levels, one or more.
        levels: number of levels in each set.
        max_strokes: largest number of strokes of an episode.
        seed: seed of the random policy.
        json: also write the results to this file, including those of every level.
    """
    from dataclasses import asdict

    from minigolf_env._atomic_io import check_output
    from minigolf_env.evaluation.benchmark import benchmark as run_benchmark
    from minigolf_env.evaluation.report import print_benchmark, write_json_report

    if json is not None:
        check_output(json, "json")
    results = list(run_benchmark(policy, difficulty, levels, max_strokes, seed))
    print_benchmark(policy, results)
    if json is not None:
        settings = {"max_strokes": max_strokes, "seed": seed}
        write_json_report(json, policy=policy, settings=settings, sets=[asdict(result) for result in results])


def _parse_position(text: str) -> tuple[float, float]:
    try:
        x, y = (float(number) for number in text.split(","))
    except ValueError:
        raise ValueError(f"tee: expected X,Y in metres, such as 0.3,0.6, received {quote(text)}.") from None
    return x, y


COMMANDS_BY_NAME: dict[str, Callable[..., None]] = {
    "play": play,
    "video": video,
    "courses": courses,
    "check": check,
    "map": map_,
    "evaluate": evaluate,
    "benchmark": benchmark,
}
"""The commands by the name that a user types."""

OPTIONS_BY_ARGUMENT = {
    "level": "first_seed",
    "model": "policy",
    "policy": "opponent",
    "position": "tee",
    "render_size": "size",
    "seed": "first_seed",
    "start_level": "first_seed",
}
"""Options by the arguments that they are passed on as, by which errors name them: a policy is a model's file in some
commands, and the opponent in another."""
