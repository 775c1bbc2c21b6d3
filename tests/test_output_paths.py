"""Paths that no file can be written to: each program says so in one line, before it computes or makes anything."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import exactness, levels, speed
from minigolf_env import cli
from minigolf_env.rendering.video_writer import VideoWriter

UNWRITABLE_FOLDER = "/proc"
"""Folder in which nobody can make a file, the administrator included."""

COMMANDS = {
    "video": ("video --output {} --policy random", ".mp4"),
    "map": ("map --output {}", ".png"),
    "check": ("check dogleg --preview {}", ".png"),
    "evaluate": ("evaluate --policy random --json {}", ".json"),
    "benchmark": ("benchmark --policy random --json {}", ".json"),
    "courses": ("courses --pictures {}", ""),
}
"""Command line of each command that writes, and the ending of the files."""

FAULTS = ("device", "folder", "below a file", "unwritable", "loop", "below a loop", "zero byte", "long name", "no user")
"""Kinds of paths that cannot be written to."""


def make_faulty_path(fault: str, folder: Path, ending: str) -> str:
    """Return a path of one of the kinds ``FAULTS``; what it needs is made in the folder."""
    (folder / "file").touch()
    (folder / f"folder{ending}").mkdir()
    (folder / f"loop{ending}").symlink_to(folder / f"loop{ending}")
    if not Path(UNWRITABLE_FOLDER).is_dir():
        pytest.skip(f"there is no {UNWRITABLE_FOLDER}")
    return {
        "device": os.devnull,
        "folder": f"{folder}/folder{ending}",
        "below a file": f"{folder}/file/new{ending}",
        "unwritable": f"{UNWRITABLE_FOLDER}/new{ending}",
        "loop": f"{folder}/loop{ending}",
        "below a loop": f"{folder}/loop{ending}/new{ending}",
        "zero byte": f"{folder}/zero\0byte{ending}",
        "long name": f"{folder}/{300 * 'n'}{ending}",
        "no user": f"~no-user-of-this-name/new{ending}",
    }[fault]


def paths_below(folder: Path) -> list[Path]:
    """Return all files and folders below a folder, sorted."""
    return sorted(folder.rglob("*"))


def check_line(line: str, what: str) -> None:
    """Check that a line names the argument and has a remedy, but no number of an error and no temporary file."""
    assert what in line and ("choose another" in line or "expected one of" in line), line
    assert "\n" not in line.strip() and "Errno" not in line and "Error" not in line, line


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", COMMANDS)
def test_command_refuses_output_before_it_computes(
    name: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names the option; nothing is printed or made before it."""
    line, ending = COMMANDS[name]
    path = make_faulty_path(fault, tmp_path, ending)
    if (name, fault) == ("courses", "folder"):
        pytest.skip("pictures go into an existing folder")
    before = paths_below(tmp_path)
    with pytest.raises(SystemExit) as caught:
        cli.main([word.format(path) for word in line.split()])
    printed = capsys.readouterr()
    assert (caught.value.code, printed.out) == (cli.EXIT_FAILED, "")
    check_line(printed.err, line.split()[line.split().index("{}") - 1].removeprefix("--"))
    assert paths_below(tmp_path) == before


def test_gallery_refuses_a_folder_in_the_place_of_a_picture(tmp_path: Path) -> None:
    """No picture is written then."""
    (tmp_path / "volcano.png").mkdir()
    with pytest.raises(SystemExit):
        cli.main(["courses", "--pictures", str(tmp_path)])
    assert paths_below(tmp_path) == [tmp_path / "volcano.png"]


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("option", ["speed json", "exactness json", "exactness figure", "levels log"])
def test_benchmark_program_refuses_output_before_it_measures(option: str, fault: str, tmp_path: Path) -> None:
    """The line names the option."""
    program, argument = option.split()
    module: Any = {"speed": speed, "exactness": exactness, "levels": levels}[program]
    path = make_faulty_path(fault, tmp_path, ".json")
    before = paths_below(tmp_path)
    with pytest.raises(SystemExit) as caught:
        module.main(module.Args(**{argument: Path(path)}))
    check_line(str(caught.value.code), argument)
    assert paths_below(tmp_path) == before


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault != "folder"])
@pytest.mark.parametrize("program", ["train_ppo", "train_generalist", "putt_map"])
def test_agent_refuses_folder_before_it_makes_a_model(program: str, fault: str, tmp_path: Path) -> None:
    """The line names the option."""
    pytest.importorskip("stable_baselines3")
    from agents import putt_map, train_generalist, train_ppo

    runs: dict[str, Callable[[Path], object]] = {
        "train_ppo": lambda out: train_ppo.main(train_ppo.PPOConfig(out=out)),
        "train_generalist": lambda out: train_generalist.main(train_generalist.GeneralistConfig(out=out)),
        "putt_map": lambda out: putt_map.main(putt_map.PuttMapConfig(out=out)),
    }
    path = Path(make_faulty_path(fault, tmp_path, ""))
    before = paths_below(tmp_path)
    with pytest.raises(SystemExit) as caught:
        runs[program](path)
    check_line(str(caught.value.code), "out: ")
    assert paths_below(tmp_path) == before


FULL_DISK_PROGRAM = """
import resource, sys
import minigolf_env.cli
resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))  # After the imports: kernels may be compiled then.
minigolf_env.cli.main(sys.argv[1:])
"""


@pytest.mark.parametrize(
    "line",
    [
        "map --directions 4 --speeds 2 --output {}.png",
        "benchmark --policy random --levels 12 --difficulty easy --max-strokes 1 --json {}.json",
        "video --policy random --size 64 48 --output {}.mp4",
        "check straight --preview {}.png",
    ],
)
def test_full_disk_is_named_and_leaves_no_file(line: str, gl: None, tmp_path: Path) -> None:
    """A limit on the size of files is what a full disk is: the last line says to free space."""
    words = [word.format(tmp_path / "out") for word in line.split()]
    result = subprocess.run(
        [sys.executable, "-c", FULL_DISK_PROGRAM, *words], capture_output=True, text=True, check=False
    )
    last = result.stderr.strip().splitlines()[-1]
    assert result.returncode == cli.EXIT_FAILED, result.stderr
    assert last.startswith(f"minigolf: {tmp_path / 'out'}") and last.endswith("choose another folder."), last
    assert "File too large" in last and "free space on the disk" in last and "Errno" not in last
    assert not paths_below(tmp_path)


def test_video_says_why_a_limit_on_file_sizes_ends_it(tmp_path: Path) -> None:
    """Ffmpeg reports the error, and is not ended by a signal without a message."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    frames = np.random.default_rng(0).integers(256, size=(100, 48, 64, 3), dtype=np.uint8)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2048, limits[1]))
        with (
            pytest.raises(OSError, match="File too large; free space"),
            VideoWriter(tmp_path / "a.mp4", (64, 48), 10) as writer,
        ):
            for frame in frames:
                writer.add(frame)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not paths_below(tmp_path)
