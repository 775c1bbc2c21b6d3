"""The benchmark programs run and print all rows, also without other engines; `make bench` measures."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
import pytest

from benchmarks import batch, exactness, levels, par, search, speed, steps
from benchmarks.energy_figure import draw_energy_error, quantile_band
from benchmarks.peers import PEER_ENGINES, load_peers
from benchmarks.peers.engine import Minigolf
from benchmarks.report import format_rate
from benchmarks.scenes import BALL_RADIUS, SCENE_BUILDERS, scene_l, scene_s, scene_t
from minigolf_env.envs.observations import OBSERVATIONS


@pytest.fixture(autouse=True)
def restore_threads() -> Iterator[None]:
    """Restore numba's number of threads, which the programs set to one."""
    before = numba.get_num_threads()
    yield
    numba.set_num_threads(before)


def test_scenes_have_the_stated_numbers_of_triangles() -> None:
    """Rates that were measured on other machines are of scenes with these sizes."""
    sizes = {name: build().triangles - 12 for name, build in SCENE_BUILDERS.items()}
    assert sizes == {"S": 0, "M": 3_008, "L": 100_352, "T": 100_352, "W": 24, "D": 3_308}


@pytest.mark.parametrize("name", ["S", "M", "W", "D", "small L", "small T"])
def test_scenes_start_putts_on_the_ground_and_sweeps_in_free_space(name: str) -> None:
    """Putts start in contact with the ground; throws and sweeps start clear of all triangles."""
    small = {"small L": lambda: scene_l(28), "small T": lambda: scene_t(28)}
    scene = {**SCENE_BUILDERS, **small}[name]()
    world = scene.world()
    rng = np.random.default_rng(0)
    positions, velocities = scene.putts(rng, 50)
    assert np.abs(world.clearance(positions)).max() < 1e-12 * world.coordinate_scale
    assert (velocities[:, 2] == 0.0).all() and (positions[:, 2] == scene.level + BALL_RADIUS).all()
    points = scene.free_points(rng, 20)
    assert len(points) == 20
    for point in (*positions[:5], *points):
        world.check_collision_free(point)


def test_speed_prints_its_tables_and_stores_the_rates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All rows are printed; the JSON file has the rows with rates."""
    budget = {"putts": 2, "sweeps": 10, "casts": 10, "rounds": 1, "triangles": 800}
    speed.main(speed.Args(**budget, scenes=("S", "M"), peers=(), json=tmp_path / "new" / "speed.json"))
    printed = capsys.readouterr().out
    rates = json.loads((tmp_path / "new" / "speed.json").read_text())["rates"]
    assert all(row in printed and rate["minigolf_env"] > 0 for row, rate in rates.items()) and len(rates) == 5
    for row in ("steps/s while putting, S", "putts to rest/s, M", "sphere sweeps/s, M", "time against", "bytes kept"):
        assert row in printed


def test_levels_benchmark_resumes_from_its_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Levels in the log are not examined again; the table stays the same."""
    log = tmp_path / "levels.jsonl"
    levels.main(levels.Args(levels=1, balls=2, difficulty=("easy",), log=log))
    before = capsys.readouterr().out
    lines = log.read_text()
    levels.main(levels.Args(levels=1, balls=2, difficulty=("easy",), log=log))
    assert capsys.readouterr().out == before and log.read_text() == lines
    assert "easy not holed out: [] faulty: []" in before and "| 100.00% |" in before
    levels.main(levels.Args(levels=2, balls=2, difficulty=("easy",), log=log))
    assert log.read_text().startswith(lines) and len(log.read_text().splitlines()) == 2


def test_par_prints_a_row_for_each_hole(capsys: pytest.CaptureFixture[str]) -> None:
    """All putts that search simulated are counted, and those that failed."""
    par.main(par.Args(rounds=2, courses=("funnel",)))
    printed = capsys.readouterr().out
    assert "| funnel | 2   | yes " in printed and "time limit 0; exhausted 0; inside a solid 0" in printed


def test_exactness_prints_and_stores_the_same_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No ball is behind a wall; the JSON file has the printed table and the energy error over time."""
    file = tmp_path / "exactness.json"
    exactness.main(exactness.Args(putts=3, slow_putts=2, throws=2, seconds=2.0, sweeps=10, peers=(), json=file))
    rows = [[cell.strip() for cell in line.split("|")] for line in capsys.readouterr().out.splitlines()]
    behind = [row for row in rows if any("behind a wall" in cell for cell in row)]
    assert len(behind) == 3 and all(row[2:4] == ["0", "0"] for row in behind)
    stored = json.loads(file.read_text())
    assert [[name, *cells.values()] for name, cells in stored["table"].items()] == [row[1:-1] for row in rows[2:-1]]
    assert list(stored["energy_error"]) == ["minigolf_env, average", "minigolf_env, conservative"]
    for error in stored["energy_error"].values():
        assert error["seconds"] == [0.0, 1.0, 2.0] and {len(row) for row in error.values()} == {3}
        assert error["quantile 0.1"] <= error["quantile 0.9"]


@pytest.mark.parametrize("script", [exactness, speed], ids=lambda script: script.__name__)
def test_stored_results_match_the_current_settings(script: Any) -> None:
    """Stored results were made with the program's default settings, and name versions and machine."""
    name = script.__name__.rpartition(".")[2]
    text = (Path(speed.__file__).parent / "results" / f"{name}.json").read_text()
    stored = json.loads(text)
    settings = dataclasses.asdict(script.Args())
    assert {**settings, **stored["settings"]} == json.loads(json.dumps(settings)) and "/" not in str(stored["settings"])
    assert {"minigolf_env", "numba", "python", *settings["peers"]} <= stored["versions"].keys()
    assert {"processor", "cores", "system"} == stored["machine"].keys()


def test_sweeps_reach_walls_at_the_closed_form_time() -> None:
    """Measured times of impact with the walls of the room are exact up to rounding."""
    error = exactness.largest_contact_error(Minigolf, exactness.Args(sweeps=200))
    assert error is not None and error < 1e-13


def test_batch_benchmark_prints_all_rows(capsys: pytest.CaptureFixture[str]) -> None:
    """Each kind of step, stable-baselines3's interface and states have a row; memory is measured elsewhere."""
    args = batch.Args(envs=3, rounds=1)
    for table in (batch.print_step_cost, batch.print_adapter_cost, batch.print_state_cost):
        table(args)
    assert sum(line.startswith("| ") for line in capsys.readouterr().out.splitlines()) == 6 + 3 + 3 + 3 * 2


def test_steps_benchmark_prints_all_rows(capsys: pytest.CaptureFixture[str]) -> None:
    """Holes, levels, each observation and each program that trains have a row; shares of a row add up to 100 %."""
    args = steps.Args(("funnel", "easy"), ("dogleg",), envs=2, observed_envs=2, rounds=1, single_steps=2, rollouts=1)
    steps.main(args)
    rows = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    titles = [row[0].strip() for row in rows]
    assert {"funnel", "easy levels"} <= set(titles)
    assert {f"dogleg, {observation}" for observation in OBSERVATIONS} <= set(titles)
    shares = [[int(cell.strip("% ")) for cell in row[2:]] for row in rows[-3:]]
    assert all(abs(sum(row) - 100) <= len(row) for row in shares)


def test_call_timer_subtracts_nested_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method's time is without that of the timed methods it calls."""
    clock = iter([0.0, 1.0, 4.0, 10.0])
    monkeypatch.setattr(steps.time, "process_time", lambda: next(clock))
    inner = SimpleNamespace(step=lambda: None)
    outer = SimpleNamespace(step=lambda: inner.step())
    timer = steps.CallTimer()
    timer.time_calls("inner", inner, "step")
    timer.time_calls("outer", outer, "step")
    outer.step()
    assert timer.seconds == {"inner": 3.0, "outer": 7.0}


def test_missing_engine_is_skipped_with_a_message(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The programs run without the engine and name the file that installs it."""
    monkeypatch.setitem(sys.modules, "rapier3d", None)
    monkeypatch.delitem(sys.modules, "benchmarks.peers.rapier", raising=False)
    assert load_peers(["rapier3d"]) == []
    assert "benchmarks/requirements.txt" in capsys.readouterr().out


@pytest.mark.filterwarnings("ignore")  # Some engines warn when they are imported.
@pytest.mark.parametrize("package", PEER_ENGINES)
def test_installed_engines_agree_on_a_rolling_ball(package: str) -> None:
    """After a second of rolling positions agree to 5 mm; a cast ends at the wall."""
    pytest.importorskip(package, reason="benchmarks/requirements.txt brings it")
    scene = scene_s()
    start = np.array([[-1.6, 0.0, BALL_RADIUS]])
    ours = Minigolf(scene)
    peer = load_peers([package])[0](scene)
    for engine in (ours, peer):
        engine.set(start, np.array([[1.0, 0.0, 0.0]]))
        engine.step(120)
    assert np.abs(peer.state()[0] - ours.state()[0]).max() < 5e-3
    assert np.abs(peer.state()[1] - ours.state()[1]).max() < 0.2
    reach = {"sphere": 0.4 - BALL_RADIUS, "ray": 0.4}[peer.cast_kind]
    raised = start + np.array([0.0, 0.0, 0.5])
    assert peer.cast(raised, raised - [1.0, 0.0, 0.0]) == pytest.approx(reach, abs=0.01)
    peer.close()


def test_rejects_unknown_engine() -> None:
    """The error lists the known engines."""
    with pytest.raises(ValueError, match=r"expected some of pybullet, .*, received 'havok'"):
        load_peers(["havok"])


def test_search_benchmark_prints_all_rows(capsys: pytest.CaptureFixture[str]) -> None:
    """Each variant of search has a row."""
    search.main(search.Args(episodes=1, levels=0))
    printed = capsys.readouterr().out
    for row in ("random", "one-putt search, fine grid", "search ", "noise, search ignores", "noise, search "):
        assert f"| {row}" in printed


def test_energy_spread_ignores_lost_balls() -> None:
    """Quantiles ignore NaN; where all balls are lost they are NaN."""
    low, middle, high = quantile_band(np.array([[1.0, 2.0, 3.0], [5.0, np.nan, 5.0], [np.nan] * 3]))
    assert middle[:2].tolist() == [2.0, 5.0] and low[0] < 2.0 < high[0] and np.isnan(middle[2])


def test_energy_figure_is_written(tmp_path: Path) -> None:
    """The SVG file and its folder are created."""
    pytest.importorskip("matplotlib", reason="benchmarks/requirements.txt brings it")
    draw_energy_error(
        {"one": np.full((9, 4), 1e-3), "lost": np.full((9, 4), np.nan)}, 2.0, tmp_path / "figures" / "energy.svg"
    )
    assert (tmp_path / "figures" / "energy.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(("number", "text"), [(1.234e6, "1.23M"), (45_600, "45.6k"), (789, "789"), (0.0123, "0.0123")])
def test_numbers_have_three_digits_and_a_unit(number: float, text: str) -> None:
    """Large numbers are abbreviated with k and M."""
    assert format_rate(number) == text
