"""Recorded runs: simulated once, with the bits of a run without a record, whatever the size of the record."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from minigolf_env.physics import batch, step
from tests.physics.test_simulate import furnished_room


@pytest.mark.parametrize("initial_rows", [1, 64, 100, 4096])
def test_recording_simulates_each_step_once(initial_rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is suspended to enlarge its record resumes where it stopped: no step is repeated or left out."""
    world, position, velocity = furnished_room(0)
    plain = world.simulate(position, velocity)
    reference = world.simulate(position, velocity, record=True)
    simulate_range = step.simulate_range
    steps_per_call: list[int] = []

    def counted(first: int, last: int, scene: Any, scratch: Any, max_steps: int, balls: Any, *record: Any) -> None:
        steps_before = int(balls.results["steps"][0])
        simulate_range(first, last, scene, scratch, max_steps, balls, *record)
        steps_per_call.append(int(balls.results["steps"][0]) - steps_before)

    monkeypatch.setattr(step, "simulate_range", counted)
    monkeypatch.setattr(batch, "INITIAL_RECORDING_ROWS", initial_rows)
    shot = world.simulate(position, velocity, record=True)
    assert shot.path is not None and shot.num_substeps is not None
    assert sum(steps_per_call) == len(shot.num_substeps) == len(shot.path) - 1 > 100
    assert len(steps_per_call) == 1 if initial_rows == 4096 else len(steps_per_call) > 1
    assert (shot.position.tobytes(), shot.velocity.tobytes()) == (plain.position.tobytes(), plain.velocity.tobytes())
    assert (shot.status, shot.time, shot.bounces, shot.exhausted) == plain[2:6]
    for name in ("path", "times", "impacts", "num_substeps"):
        assert np.asarray(getattr(shot, name)).tobytes() == np.asarray(getattr(reference, name)).tobytes()


def test_record_ends_at_the_time_limit() -> None:
    """A run that reaches ``max_time`` has a row for the start and one for each step, also when the record is full."""
    world, position, velocity = furnished_room(0)
    for num_steps in (1, 5, batch.INITIAL_RECORDING_ROWS - 1, batch.INITIAL_RECORDING_ROWS):
        shot = world.simulate(position, 3.0 * velocity, max_time=num_steps * world.dt, record=True)
        assert shot.path is not None and shot.times is not None
        assert len(shot.path) == len(shot.times) <= num_steps + 1
        assert np.array_equal(shot.path[-1], shot.position)
        assert shot.times[-1] == shot.time
