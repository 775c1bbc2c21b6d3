"""Checks of the programs' arguments and of stored runs, before a program makes or changes any file."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator
from typing import Any

import torch
from pydantic import TypeAdapter, ValidationError

from minigolf_env._validation import quote, quote_unless_plain
from minigolf_env.apps.putt_map import MAX_MAP_ROWS
from minigolf_env.evaluation import NUM_EVALUATION_SEEDS

MAX_COUNT = 2**31 - 1
"""Largest integer accepted: a seed plus a number of time steps is again a seed."""

RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, MAX_COUNT),
    "eval_seed": (0, MAX_COUNT),
    "n_eval_episodes": (1, NUM_EVALUATION_SEEDS),
    "n_test_episodes": (1, NUM_EVALUATION_SEEDS),
    "n_episodes": (1, NUM_EVALUATION_SEEDS),
    "n_search_episodes": (0, NUM_EVALUATION_SEEDS),
    "learning_starts": (0, MAX_COUNT),
    "num_learners": (0, 1024),
    "directions": (1, MAX_MAP_ROWS),
    "speeds": (1, MAX_MAP_ROWS),
    "batch_size": (2, 1_000_000),
    "num_env_runners": (1, 10_000),
    "learning_rate": (0.0, 1.0),
    "gamma": (0.0, 1.0),
    "gae_lambda": (0.0, 1.0),
    "greedy_prob": (0.0, 1.0),
    "replay_ratio": (0.0, 10_000.0),
    "ent_coef": (0.0, math.inf),
    "log_std_init": (-20.0, 2.0),
    "log_std_final": (-20.0, 2.0),
}
"""Smallest and largest value of arguments; the other integers are from 1 to MAX_COUNT, the other numbers above 0."""

OPTIONAL_ARGUMENTS = ("num_levels",)
"""Arguments that are checked elsewhere."""


def check_types(expected_type: Any, values: Any) -> Any:
    """Return values of a JSON file as an instance of a type, or raise a ValueError that names the faulty one."""
    try:
        return TypeAdapter(expected_type).validate_python(values)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        name = quote_unless_plain(".".join(map(str, fault["loc"])) or "configuration")
        raise ValueError(f"{name}: {fault['msg'].lower()}, received {quote(fault['input'])}.") from error


def check_ranges(config: Any) -> None:
    """Raise a ValueError that names the first number of a configuration that is out of its range."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        values = value if isinstance(value, tuple) and field.name == "net_arch" else (value,)
        for number in values:
            if isinstance(number, bool) or not isinstance(number, (int, float)) or field.name in OPTIONAL_ARGUMENTS:
                continue
            low, high = RANGES.get(field.name, (1, MAX_COUNT) if isinstance(number, int) else (0.0, math.inf))
            is_open = field.name not in RANGES and isinstance(number, float)
            if not (math.isfinite(number) and low <= number <= high) or (is_open and number == 0.0):
                expected = f"above {low:g}" if is_open else f"at least {low:g}"
                limit = "" if math.isinf(high) else f" and at most {high:,}"
                raise ValueError(f"{field.name}: expected a number {expected}{limit}, received {quote(value)}.")


def check_count(value: Any, what: str) -> int:
    """Return a count of a stored run, or raise a ValueError if it is not an integer of at least 0."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MAX_COUNT:
        raise ValueError(f"{what}: expected an integer from 0 to {MAX_COUNT}, received {quote(value)}")
    return value


def check_weights(module: torch.nn.Module) -> None:
    """Raise a ValueError if a weight of a network is infinite or not a number: it cannot play or learn."""
    for name, weights in module.state_dict().items():
        if not bool(torch.isfinite(weights).all()):
            raise ValueError(f"{name}: expected finite weights, received others")


@contextlib.contextmanager
def one_line_errors(expectation: str) -> Iterator[None]:
    """End the program with one line if the block raises an error: libraries raise errors of many kinds.

    Args:
        expectation: beginning of the line, such as "resume: expected an intact model".
    """
    try:
        yield
    except Exception as error:
        text = " ".join(str(error).split())
        reason = text if isinstance(error, (OSError, ValueError)) and text else f"{type(error).__name__} {text}"
        raise SystemExit(f"{expectation}, received {reason.strip():.300}") from error
