"""Maps: what they are drawn from is what the environment plays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from minigolf_env import cli
from minigolf_env.apps.putt_map import draw_map, simulate, write_map
from minigolf_env.courses import load_course
from minigolf_env.envs import MiniGolfEnv


def test_the_putts_of_a_map_are_those_of_the_environment() -> None:
    """Direction by direction, speed by speed."""
    putts = simulate("dogleg", tee=(0.3, 0.6), directions=12, speeds=5)
    env = MiniGolfEnv(course="dogleg")
    env.reset(options={"position": (0.3, 0.6, 0.02135)})
    turn, share = np.radians(putts.directions[7]), putts.speeds[3] / 6.0
    played = env.what_if([[share * np.cos(turn), share * np.sin(turn)]])
    assert putts.outcome.position.shape == (12, 5, 3)
    assert np.allclose(played.position[0], putts.outcome.position[7, 3], rtol=0.0, atol=1e-9)


def test_a_map_in_parts_is_the_same_map() -> None:
    """To the last bit: some directions alone, and among all."""
    whole, part = simulate("bank", directions=7, speeds=3), simulate("bank", directions=7, speeds=3, among=range(2, 5))
    assert part.directions.tobytes() == whole.directions[2:5].tobytes()
    for some, every in zip(part.outcome, whole.outcome, strict=True):
        assert some.tobytes() == every[2:5].tobytes()


def test_a_map_is_drawn_on_axes_and_written(tmp_path: Path) -> None:
    """From Python and as a picture."""
    from matplotlib.figure import Figure

    path = tmp_path / "maps" / "map.png"
    putts = write_map(path, "islands", directions=24, speeds=6)
    assert path.read_bytes()[:4] == b"\x89PNG"
    axes = Figure().subplots()
    draw_map(axes, load_course("islands"), putts)
    assert "144 putts" in axes.get_title()


def test_a_tee_in_a_wall_is_refused() -> None:
    """As the environment does."""
    with pytest.raises(ValueError, match="expected a ball in free space"):
        simulate("dogleg", tee=(3.3, 1.5), directions=4, speeds=2)


def test_maps_that_cannot_be_are_refused_before_the_putts(tmp_path: Path) -> None:
    """No directions, or a picture of no known kind."""
    with pytest.raises(ValueError, match=r"directions and speeds >= 1, received \(0, 2\)"):
        simulate("dogleg", directions=0, speeds=2)
    with pytest.raises(ValueError, match=r"output: the file's ending: expected one of .*'png'.*received 'pgn'"):
        write_map(tmp_path / "map.pgn", "dogleg")


@pytest.mark.parametrize("tee", ["0.3", "a,b", "0.3,0.6,1", "0.3,nan"])
def test_a_tee_is_two_numbers(tee: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Anything else is one line, and no picture."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["map", "-o", str(tmp_path / "map.png"), "--tee", tee])
    assert caught.value.code == cli.FAILED and capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())
