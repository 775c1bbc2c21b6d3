"""The ``minigolf`` command: play a hole, film a policy that does, or score it.

A command's docstring is its help, and what it needs is imported when it runs, so that ``--help`` is quick.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

from minigolf_env import __version__

if TYPE_CHECKING:
    import tyro


def _imported_when_used(name: str) -> ModuleType:
    """Return a module that is loaded when it is first looked into: see "Implementing lazy imports" in Python's docs."""
    spec = importlib.util.find_spec(name)
    if name in sys.modules or spec is None or spec.loader is None:
        return importlib.import_module(name)
    spec.loader = importlib.util.LazyLoader(spec.loader)
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if not TYPE_CHECKING:
    tyro = _imported_when_used("tyro")  # It takes as long as all else that the list of commands needs.

FAILED = 1
"""Exit code of a command that could not do what it was asked; 2 is a wrong command line's."""

NO_DISPLAY = 2
"""Exit code of a command that cannot draw here."""

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""


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
        course: a hole, "round" for the nine of a round, or "room" to throw a ball in three dimensions.
        opponent: plays against you: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        size: of the window, pixels.
        profile: "high", "fast" or "auto".
        log: print each event as a line of JSON, for programs that watch.
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
    """Film a policy that plays a hole, a round, or levels.

    $ minigolf video -o putt.mp4
    $ minigolf video --policy ppo --camera top --size 1280 720
    $ minigolf video --course round --episodes 9 -o round.mp4
    $ minigolf video --course procedural --difficulty medium --policy generalist

    Args:
        output: the file to write, .mp4 or .gif.
        course: a hole's name or file, "round" for nine in turn, or "procedural" for levels.
        difficulty: of levels: easy, medium or hard.
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        episodes: how many to play: 9 are a whole round.
        seed: of the environment and the random policy.
        camera: "follow", "top", "tee" or "orbit".
        size: width and height, pixels.
        fps: pictures a second.
        profile: "high" or "fast".
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
    """List the bundled courses: par, size, triangles, and what makes them fun.

    $ minigolf courses
    $ minigolf courses --pictures pictures

    Args:
        pictures: a folder to write a picture of each to, and all of them on one sheet, courses.png.
    """
    from minigolf_env.apps.course_check import table, write_pictures

    print(table())
    if pictures is not None:
        print(f"wrote {write_pictures(pictures)}")


def check(file: Annotated[str, tyro.conf.Positional], preview: Path | None = None) -> None:
    """Say what is wrong with a hole of your own; exit with 0 if nothing is, else with 1.

    $ minigolf check my_hole.toml
    $ minigolf check my_hole.glb --preview my_hole.png

    Args:
        file: a .toml or .glb file, or a bundled course's name.
        preview: a picture to write, if the hole can be loaded: .png.
    """
    from minigolf_env.apps.course_check import check as course_errors
    from minigolf_env.apps.course_check import write_preview
    from minigolf_env.courses import CourseError, load_course

    faults = list(course_errors(file))
    for fault in faults:
        print(fault, file=sys.stderr)
    try:
        course = load_course(file)
    except CourseError:
        sys.exit(FAILED)
    if preview is not None:
        write_preview(course, preview)
        print(f"wrote {preview}")
    if faults:
        sys.exit(FAILED)
    print(f"{course.name}: nothing is wrong.")


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
        output: the picture to write.
        course: a hole's name or file.
        tee: place of the ball, m, such as 0.3,0.6; left out: the middle of the tee.
        directions: how many.
        speeds: how many.
    """
    from minigolf_env.apps.putt_map import write_map

    place = None if tee is None else _place(tee)
    putts = write_map(output, course, place, directions, speeds, progress=True)
    print(f"wrote {output}: {putts.outcome.result.size:,} putts, {putts.outcome.holed.sum():,} holes in one")


def evaluate(
    policy: str = "search",
    course: str = "dogleg",
    difficulty: str | None = None,
    episodes: int = 100,
    first_seed: int = 1_000_000,
    max_strokes: int = 10,
    putt_noise: tuple[float, float] = (0.0, 0.0),
    watch: bool = False,
    json: Path | None = None,
) -> None:
    """Score a policy on a hole or on levels: strokes over fixed seeds, with confidence intervals.

    $ minigolf evaluate --policy ppo
    $ minigolf evaluate --policy runs/dogleg-1/best.zip --episodes 1000 --json score.json
    $ minigolf evaluate --policy search --course procedural --difficulty medium --watch

    Args:
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        course: a hole's name or file, "round" for nine in turn, or "procedural" for levels.
        difficulty: of levels.
        episodes: how many.
        first_seed: episode i is seeded with so much more than i, or played on that level; seeds a random policy, too.
        max_strokes: of an episode.
        putt_noise: standard deviations of direction (degrees) and speed (share of it).
        watch: show the putts in a window.
        json: also write the score to this file.
    """
    from dataclasses import asdict

    from minigolf_env._atomic_io import check_output
    from minigolf_env.evaluation.evaluate import evaluate as evaluate_policy
    from minigolf_env.evaluation.report import print_evaluations, write_json_report
    from minigolf_env.players.policies import load_policy

    if json is not None:
        check_output(json)
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
    """Score a policy on fixed training levels and on levels held out, beside search.

    $ minigolf benchmark --policy random --difficulty easy --levels 20
    $ minigolf benchmark --policy runs/procedural-1/best.npz --json scores.json

    Args:
        policy: "search", "random", "ppo", "generalist" or a model's .zip or .npz file.
        difficulty: of the levels, one or more.
        levels: in each set.
        max_strokes: of an episode.
        seed: of the random policy.
        json: also write the scores to this file, with those of every level.
    """
    from dataclasses import asdict

    from minigolf_env._atomic_io import check_output
    from minigolf_env.evaluation.benchmark import benchmark as run_benchmark
    from minigolf_env.evaluation.report import print_benchmark, write_json_report

    if json is not None:
        check_output(json)
    results = list(run_benchmark(policy, difficulty, levels, max_strokes, seed))
    print_benchmark(policy, results)
    if json is not None:
        settings = {"max_strokes": max_strokes, "seed": seed}
        write_json_report(json, policy=policy, settings=settings, sets=[asdict(result) for result in results])


COMMANDS = (play, video, courses, check, map_, evaluate, benchmark)

DESCRIPTION = "Play minigolf, film a policy that does, or score it."

EPILOG = """examples:       minigolf COMMAND --help
completion:     minigolf --tyro-write-completion {bash,zsh,tcsh} FILE
exit codes:     0 done; 1 failed; 2 a wrong command line, or nowhere to draw"""


def _place(text: str) -> tuple[float, float]:
    try:
        x, y = (float(number) for number in text.split(","))
    except ValueError:
        raise ValueError(f"tee: expected X,Y in metres, such as 0.3,0.6, received {text!r}.") from None
    return x, y


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line, or the given arguments; a user's mistake is one line on stderr."""
    words = list(sys.argv[1:] if args is None else args)
    try:
        _run(words)
        sys.stdout.flush()
    except BrokenPipeError:  # Whoever read the output has seen enough: `minigolf courses | head -3`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError, ImportError, MemoryError) as error:
        sys.exit(_say(error, FAILED))
    except RuntimeError as error:
        from minigolf_env.rendering import RenderingError

        if not isinstance(error, RenderingError):
            raise
        sys.exit(_say(error, NO_DISPLAY))
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


def _run(words: Sequence[str]) -> None:
    """Let argparse find the command, and tyro read what it is to do."""
    commands = {command.__name__.rstrip("_"): command for command in COMMANDS}
    if words[:1] == ["--tyro-write-completion"]:
        tyro.extras.subcommand_cli_from_dict(commands, prog="minigolf", args=words)
    style = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("minigolf", description=DESCRIPTION, epilog=EPILOG, formatter_class=style)
    parser.add_argument("--version", action="version", version=f"minigolf_env {__version__}")
    known = parser.add_subparsers(title="commands", metavar="COMMAND", dest="command", required=True)
    for name, command in commands.items():
        known.add_parser(name, help=str(command.__doc__).splitlines()[0], add_help=False)
    name = parser.parse_args(words[:1]).command
    tyro.cli(commands[name], prog=f"minigolf {name}", args=words[1:])


def _say(error: Exception, code: int) -> int:
    print(f"minigolf: {error}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
