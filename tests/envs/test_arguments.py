"""Arguments of the environments of any type and length: errors of our own, in few characters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from minigolf_env.envs import MiniGolfEnv, MiniGolfVectorEnv
from minigolf_env.envs.config import EnvOptions

LONG_TEXT = "x" * 100_000
ODD_VALUES: list[Any] = [
    LONG_TEXT,
    "\x1b[31m",
    10**5000,
    -(10**5000),
    [LONG_TEXT] * 3,
    [[1], [1, 2]],
    {LONG_TEXT: 1},
    {10**5000: 1},
    np.zeros((2, 5)),
    np.array([LONG_TEXT, "a"]),
    b"x" * 100_000,
    1j,
    object(),
]


def message_of(call: Callable[[], object]) -> str:
    """Return the message of the ValueError that a call raises."""
    with pytest.raises(ValueError, match="expected") as error:
        call()
    message = str(error.value)
    assert len(message) < 1000 and all(c.isprintable() or c == "\n" for c in message)
    return message


@pytest.mark.parametrize("number", range(len(ODD_VALUES)))
@pytest.mark.parametrize("name", ["course", *EnvOptions.__annotations__])
def test_arguments_of_environments(name: str, number: int) -> None:
    """The message names the argument and shows the value shortened, on a hole and on levels."""
    value = ODD_VALUES[number]
    for course in ("straight", "procedural"):
        given = {"course": course, name: value}
        shown = message_of(lambda given=given: MiniGolfEnv(**given))  # type: ignore[misc]
        assert name in shown
        assert message_of(lambda given=given: MiniGolfVectorEnv(2, **given)) == shown  # type: ignore[misc]


@pytest.mark.parametrize("number", range(len(ODD_VALUES)))
def test_arguments_of_methods(number: int) -> None:
    """Actions, options and states are refused, and the episodes stay as they are."""
    value = ODD_VALUES[number]
    env = MiniGolfEnv("straight")
    env.reset(seed=0)
    envs = MiniGolfVectorEnv(2, "straight")
    envs.reset(seed=0)
    before = env.get_state(), envs.get_state()
    for call in (
        lambda: env.step(value),
        lambda: env.what_if(value),
        lambda: env.reset(options=value),
        lambda: env.reset(options={"position": value}),
        lambda: env.reset(options={"level": value}),
        lambda: env.set_state(value),
        lambda: env.set_state({**before[0], "strokes": value}),
        lambda: env.set_state({**before[0], "over": value}),
        lambda: env.set_state({**before[0], "np_random": value}),
        lambda: envs.step(value),
        lambda: envs.what_if(value),
        lambda: envs.reset(options={"level": value}),
        lambda: envs.reset(options={"reset_mask": value}),
        lambda: envs.set_state(value),
    ):
        message_of(call)
    assert repr((env.get_state(), envs.get_state())) == repr(before)
