"""Tests of the game in a real window, on a virtual desktop, with synthetic mouse and keyboard events."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from minigolf_env.courses import list_courses
from tests.apps.play.xdo import MISSING_TOOLS, TIMEOUT, GameDriver, virtual_desktop

CARD_ROW = 1 + list_courses().index("dogleg")
"""Index of the dogleg's row on the score card; row 0 is the header."""

needs_desktop = pytest.mark.skipif(
    bool(MISSING_TOOLS), reason=f"needs a virtual desktop; not installed: {MISSING_TOOLS}"
)

SMALL_WINDOW = ("--size", "400", "250")
"""Arguments for a window that is drawn quickly."""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """Yield the name of a display that these tests share."""
    with virtual_desktop() as name:
        yield name


def move_to_ball(game: GameDriver) -> tuple[int, int]:
    """Wait until the player may strike, move the mouse to the ball, and return its pixel."""
    x, y = game.wait("idle", ready=True)["ball"]
    game.move(x, y)
    return x, y


@needs_desktop
def test_plays_a_hole_with_mouse_and_keys(display: str, tmp_path: Path) -> None:
    """Mouse and keys aim, cancel, putt, replay, undo, hint, hole out, resize, start the next hole and quit."""
    with GameDriver(display, tmp_path) as game:
        x, y = move_to_ball(game)
        for cancel in (lambda: game.xdotool("click", 3), lambda: game.move(x, y + 4)):
            game.move(x, y)
            game.xdotool("mousedown", 1)
            game.move(x + 30, y + 90)
            cancel()
            game.xdotool("mouseup", 1)
        game.move(x, y)
        game.xdotool("mousedown", 1)
        game.move(x, y + 60)
        game.move(x, y + 120)
        game.xdotool("mouseup", 1)
        putt = game.wait("putt")
        assert putt["power"] == pytest.approx((120 / 600 - 0.025) / 0.375, abs=0.01)
        assert putt["x"] > abs(putt["y"])
        assert [event["event"] for event in game.events].count("putt") == 1
        game.wait("rest", status="rest", strokes=1)
        game.press("r", "space")
        game.wait("replayed")
        game.press("z")
        game.wait("undo", strokes=0)
        move_to_ball(game)
        game.press("h")
        hint = game.wait("hint")
        game.press("Return", "space")
        assert game.wait("putt")["x"] == hint["x"]
        game.wait("rest", status="holed", strokes=1)
        assert game.wait("hole_over")["rows"][CARD_ROW] == ["Dogleg", "2", "1 *", "–"]
        game.xdotool("windowsize", game.window_id(), 700, 420)
        assert game.wait("idle", size=[700, 420])["ready"] is False
        game.move(300, 200)
        game.press("n")
        game.wait("hole", name=list_courses()[CARD_ROW])
        move_to_ball(game)
        game.press("f")
        game.wait("idle", size=[1280, 900])
        game.press("f")
        game.wait("idle", size=[700, 420])
        game.move(300, 200)
        game.press("Escape")
        game.wait("closed")
        assert game.exit_code() == 0, game.errors()


@needs_desktop
def test_opponent_plays_and_best_scores_are_stored(display: str, tmp_path: Path) -> None:
    """The next game reads the best score; the window may be closed during a putt."""
    with GameDriver(display, tmp_path, "--opponent", "search", *SMALL_WINDOW) as game:
        move_to_ball(game)
        game.press("h")
        game.wait("hint")
        game.press("Return", "space")
        game.wait("rest", player="You", status="holed")
        game.press("space")
        game.wait("rest", player="search", status="holed")
        assert game.wait("hole_over")["rows"][CARD_ROW] == ["Dogleg", "2", "1", "1", "1"]
        game.close()
        assert game.exit_code() == 0, game.errors()
    scores = tmp_path / "data" / "minigolf_env" / "scores.json"
    assert json.loads(scores.read_text())["best"] == {"dogleg": 1}
    with GameDriver(display, tmp_path, *SMALL_WINDOW) as game:
        move_to_ball(game)
        game.press("Tab", "Up")
        game.wait("aim")
        game.press("Return")
        game.wait("putt")
        game.close()
        assert game.exit_code() == 0, game.errors()


@needs_desktop
def test_idle_window_uses_no_cpu_and_needs_no_fonts(display: str, tmp_path: Path) -> None:
    """The keyboard alone is enough to play, and closing does not wait for a hint."""
    (tmp_path / "fonts.conf").write_text("<fontconfig></fontconfig>")
    with GameDriver(display, tmp_path, *SMALL_WINDOW, FONTCONFIG_FILE=str(tmp_path / "fonts.conf")) as game:
        move_to_ball(game)
        game.press("Left")
        first = game.wait("aim")
        game.press("shift+Right", "Up")
        game.wait("aim")
        second = game.wait("aim")
        assert second["power"] == pytest.approx(first["power"] + 0.02)
        game.wait("idle")
        before = game.cpu_seconds()
        time.sleep(0.5)
        assert game.cpu_seconds() - before < 0.1
        game.press("h", "Escape")
        assert game.exit_code() == 0, game.errors()


@needs_desktop
def test_throws_in_the_room(display: str, tmp_path: Path) -> None:
    """A key changes the elevation of a throw; keys of golf do nothing in the room."""
    with GameDriver(display, tmp_path, "--course", "room", *SMALL_WINDOW) as game:
        move_to_ball(game)
        game.press("h", "z", "n", "Tab", "w")
        assert game.wait("aim")["elevation"] == 35.0
        game.press("space")
        game.wait("putt")
        game.press("space")
        game.wait("rest", strokes=1)
        game.wait("idle")
        game.xdotool("windowclose", game.window_id())  # Destroys the window from outside.
        assert game.exit_code() == 0, game.errors()


@needs_desktop
def test_records_a_putt_as_a_video(display: str, tmp_path: Path) -> None:
    """The file is written to the current folder."""
    with GameDriver(display, tmp_path, *SMALL_WINDOW) as game:
        move_to_ball(game)
        game.press("v")
        game.wait("recording", on=True)
        game.press("Down")
        game.wait("aim")
        game.press("Return")
        game.wait("rest")
        game.press("v")
        game.wait("recording", on=False)
        game.press("Escape")
        assert game.exit_code() == 0, game.errors()
    assert (tmp_path / "minigolf-dogleg-1.mp4").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "exit_code", "message"),
    [
        ([], 2, "`minigolf play`"),
        (["--course", "dogleq"], 1, "did you mean 'dogleg'"),
        (["--opponent", "serach"], 1, "did you mean 'search'"),
        (["--opponent", "search", "--course", "room"], 1, "opponent"),
        (["--profile", "slow"], 1, "profile"),
        (["--size", "0", "600"], 1, "size"),
    ],
)
def test_invalid_arguments_are_reported_in_one_line(arguments: list[str], exit_code: int, message: str) -> None:
    """A missing display is reported in the same way."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    command = [sys.executable, "-m", "minigolf_env.cli", "play", *arguments]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=TIMEOUT)
    assert result.returncode == exit_code, result.stderr
    assert result.stderr.startswith("minigolf: ") and result.stderr.count("\n") == 1
    assert message in result.stderr
