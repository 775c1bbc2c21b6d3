"""The game in a real window, on a virtual desktop, played with a synthetic mouse and keyboard."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from minigolf_env.courses import list_courses
from tests.apps.play.xdo import MISSING, PATIENCE, Player, desktop

HOLE = 1 + list_courses().index("dogleg")
"""The dogleg's row on the card; the first is the head."""

needs_desktop = pytest.mark.skipif(bool(MISSING), reason=f"needs a virtual desktop; not installed: {MISSING}")

SMALL = ("--size", "400", "250")
"""A window that is drawn quickly."""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """Return the name of a display that these tests share."""
    with desktop() as name:
        yield name


def aim_at(player: Player) -> tuple[int, int]:
    """Wait until the player may strike, move the mouse to the ball, and return where that is."""
    x, y = player.wait("idle", ready=True)["ball"]
    player.move(x, y)
    return x, y


@needs_desktop
def test_a_hole_with_mouse_and_keys(display: str, tmp_path: Path) -> None:
    """Aim, cancel, putt, replay, undo, ask for a hint, hole out, see the card, resize, go on, and quit."""
    with Player(display, tmp_path) as player:
        x, y = aim_at(player)
        for cancel in (lambda: player.do("click", 3), lambda: player.move(x, y + 4)):
            player.move(x, y)
            player.do("mousedown", 1)
            player.move(x + 30, y + 90)
            cancel()
            player.do("mouseup", 1)
        player.move(x, y)
        player.do("mousedown", 1)
        player.move(x, y + 60)
        player.move(x, y + 120)
        player.do("mouseup", 1)
        putt = player.wait("putt")
        assert putt["power"] == pytest.approx((120 / 600 - 0.025) / 0.375, abs=0.01)
        assert putt["x"] > abs(putt["y"])
        assert [event["event"] for event in player.seen].count("putt") == 1
        player.wait("rest", status="rest", strokes=1)
        player.key("r", "space")
        player.wait("replayed")
        player.key("z")
        player.wait("undo", strokes=0)
        aim_at(player)
        player.key("h")
        hint = player.wait("hint")
        player.key("Return", "space")
        assert player.wait("putt")["x"] == hint["x"]
        player.wait("rest", status="holed", strokes=1)
        assert player.wait("over")["rows"][HOLE] == ["Dogleg", "2", "1 *", "–"]
        player.do("windowsize", player.window(), 700, 420)
        assert player.wait("idle", size=[700, 420])["ready"] is False
        player.move(300, 200)
        player.key("n")
        player.wait("hole", name=list_courses()[HOLE])
        aim_at(player)
        player.key("f")
        player.wait("idle", size=[1280, 900])
        player.key("f")
        player.wait("idle", size=[700, 420])
        player.move(300, 200)
        player.key("Escape")
        player.wait("closed")
        assert player.ended() == 0, player.errors()


@needs_desktop
def test_the_opponent_and_the_scores_of_the_next_game(display: str, tmp_path: Path) -> None:
    """A hole in one is remembered when the game is opened again; the window may close in the middle of a putt."""
    with Player(display, tmp_path, "--opponent", "search", *SMALL) as player:
        aim_at(player)
        player.key("h")
        player.wait("hint")
        player.key("Return", "space")
        player.wait("rest", who="You", status="holed")
        player.key("space")
        player.wait("rest", who="search", status="holed")
        assert player.wait("over")["rows"][HOLE] == ["Dogleg", "2", "1", "1", "1"]
        player.close()
        assert player.ended() == 0, player.errors()
    scores = tmp_path / "data" / "minigolf_env" / "scores.json"
    assert json.loads(scores.read_text())["best"] == {"dogleg": 1}
    with Player(display, tmp_path, *SMALL) as player:
        aim_at(player)
        player.key("Tab", "Up")
        player.wait("aim")
        player.key("Return")
        player.wait("putt")
        player.close()
        assert player.ended() == 0, player.errors()


@needs_desktop
def test_without_fonts_an_idle_window_costs_nothing(display: str, tmp_path: Path) -> None:
    """The keyboard alone plays, an idle window takes no processor time, and closing does not wait for a hint."""
    (tmp_path / "fonts.conf").write_text("<fontconfig></fontconfig>")
    with Player(display, tmp_path, *SMALL, FONTCONFIG_FILE=str(tmp_path / "fonts.conf")) as player:
        aim_at(player)
        player.key("Left")
        first = player.wait("aim")
        player.key("shift+Right", "Up")
        player.wait("aim")
        second = player.wait("aim")
        assert second["power"] == pytest.approx(first["power"] + 0.02)
        player.wait("idle")
        before = player.cpu()
        time.sleep(0.5)
        assert player.cpu() - before < 0.1
        player.key("h", "Escape")
        assert player.ended() == 0, player.errors()


@needs_desktop
def test_the_room(display: str, tmp_path: Path) -> None:
    """A throw is raised by a key and bounces; without a hole, golf's keys do nothing."""
    with Player(display, tmp_path, "--course", "room", *SMALL) as player:
        aim_at(player)
        player.key("h", "z", "n", "Tab", "w")
        assert player.wait("aim")["elevation"] == 35.0
        player.key("space")
        player.wait("putt")
        player.key("space")
        player.wait("rest", strokes=1)
        player.wait("idle")
        player.do("windowclose", player.window())  # Destroys it from outside.
        assert player.ended() == 0, player.errors()


@needs_desktop
def test_a_film_of_a_putt(display: str, tmp_path: Path) -> None:
    """It is written where the game was started."""
    with Player(display, tmp_path, *SMALL) as player:
        aim_at(player)
        player.key("v")
        player.wait("film", on=True)
        player.key("Down")
        player.wait("aim")
        player.key("Return")
        player.wait("rest")
        player.key("v")
        player.wait("film", on=False)
        player.key("Escape")
        assert player.ended() == 0, player.errors()
    assert (tmp_path / "minigolf-dogleg-1.mp4").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([], 2, "`minigolf play`"),
        (["--course", "dogleq"], 1, "did you mean 'dogleg'"),
        (["--opponent", "serach"], 1, "did you mean 'search'"),
        (["--opponent", "search", "--course", "room"], 1, "opponent"),
        (["--profile", "slow"], 1, "profile"),
        (["--size", "0", "600"], 1, "size"),
    ],
)
def test_what_cannot_be_played_is_one_clear_line(arguments: list[str], code: int, words: str) -> None:
    """Without a display, or with arguments that make no sense."""
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    command = [sys.executable, "-m", "minigolf_env.cli", "play", *arguments]
    got = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE)
    assert got.returncode == code, got.stderr
    assert got.stderr.startswith("minigolf: ") and got.stderr.count("\n") == 1
    assert words in got.stderr
