"""Putt maps: their outcomes are those of the environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minigolf_env import cli
from minigolf_env.apps.putt_map import draw_map, draw_polar, simulate_putts, write_map
from minigolf_env.courses import load_course
from minigolf_env.envs import MiniGolfEnv, Result


def test_outcomes_match_environment() -> None:
    """A putt of the map ends where the environment's putt of the same direction and speed ends."""
    putts = simulate_putts("dogleg", tee=(0.3, 0.6), directions=12, speeds=5)
    env = MiniGolfEnv(course="dogleg")
    env.reset(options={"position": (0.3, 0.6, 0.02135)})
    turn, share = np.radians(putts.directions[7]), putts.speeds[3] / 6.0
    played = env.what_if([[share * np.cos(turn), share * np.sin(turn)]])
    assert putts.outcome.position.shape == (12, 5, 3)
    assert np.allclose(played.position[0], putts.outcome.position[7, 3], rtol=0.0, atol=1e-9)


def test_range_of_directions_has_same_bits_as_whole_map() -> None:
    """A map can be simulated in parts."""
    whole = simulate_putts("bank", directions=7, speeds=3)
    part = simulate_putts("bank", directions=7, speeds=3, direction_range=range(2, 5))
    assert part.directions.tobytes() == whole.directions[2:5].tobytes()
    for part_field, whole_field in zip(part.outcome, whole.outcome, strict=True):
        assert part_field.tobytes() == whole_field[2:5].tobytes()


def test_writes_map_and_draws_it_on_axes(tmp_path: Path) -> None:
    """The file is an image; the title has the number of putts."""
    from matplotlib.figure import Figure

    path = tmp_path / "maps" / "map.png"
    putts = write_map(path, "islands", directions=24, speeds=6)
    assert path.read_bytes()[:4] == b"\x89PNG"
    axes = Figure().subplots()
    draw_map(axes, load_course("islands"), putts)
    assert "144 putts" in axes.get_title()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["where a putt ends", "ball", "cup"]


def test_greys_of_the_colour_bar_are_those_of_the_distances(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The written map has a colour bar, whose colour at a distance is that of the putts that end there."""
    from matplotlib.figure import Figure

    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    putts = write_map(tmp_path / "map.png", "dogleg", directions=24, speeds=6)
    left, right, bar = figures[0].axes
    assert bar.get_ylabel() == "distance from the ball to where the putt ends (m)"
    assert (left.get_xlabel(), right.get_xlabel()) == ("x (m)", "speed (m/s)")
    distances = np.linalg.norm(putts.outcome.position - putts.start, axis=-1)
    assert bar.get_ylim() == (0.0, pytest.approx(distances.max(), rel=1e-3))
    image = np.asarray(right.images[0].get_array())
    at_rest = putts.outcome.result == Result.REST
    greys = draw_polar(Figure().subplots(), putts).to_rgba(distances[at_rest])
    assert np.allclose(image[at_rest], greys[:, :3], rtol=0.0, atol=0.01)
    assert np.ptp(greys[:, 0]) > 0.3 and not np.ptp(greys[:, :3], axis=1).any()


@pytest.mark.parametrize("course", ["halfpipe", "funnel"])
def test_legend_covers_no_label(course: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a wide course as on one that is about square."""
    from matplotlib.figure import Figure

    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    write_map(tmp_path / "map.png", course, directions=4, speeds=2)
    figures[0].draw_without_rendering()
    left = figures[0].axes[0]
    legend = left.get_legend().get_window_extent()
    assert legend.y0 > 0.0 and legend.y1 < left.xaxis.label.get_window_extent().y0


def test_rejects_tee_inside_wall() -> None:
    """The error message is that of the environment."""
    with pytest.raises(ValueError, match="expected a ball in free space"):
        simulate_putts("dogleg", tee=(3.3, 1.5), directions=4, speeds=2)


def test_rejects_invalid_arguments_before_simulating(tmp_path: Path) -> None:
    """Zero directions and an unknown file ending are errors, and no putt is simulated."""
    with pytest.raises(ValueError, match=r"directions: expected an integer from 1 to .*, received 0"):
        simulate_putts("dogleg", directions=0, speeds=2)
    with pytest.raises(ValueError, match=r"output: the file's ending: expected one of .*'png'.*received 'pgn'"):
        write_map(tmp_path / "map.pgn", "dogleg")


@pytest.mark.parametrize("tee", ["0.3", "a,b", "0.3,0.6,1", "0.3,nan"])
def test_command_rejects_tee_that_is_not_two_numbers(
    tee: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error is one line, and no file is written."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["map", "-o", str(tmp_path / "map.png"), "--tee", tee])
    assert caught.value.code == cli.EXIT_FAILED and capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())
