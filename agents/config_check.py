"""Checks of training arguments: types and ranges, before a run makes any file."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from pydantic import TypeAdapter, ValidationError

RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, 2**32 - 1),
    "eval_seed": (0, 2**31 - 1),
    "n_search_episodes": (0, math.inf),
    "learning_starts": (0, math.inf),
    "num_learners": (0, 1024),
    "batch_size": (2, 2**31 - 1),
    "num_env_runners": (1, 10_000),
    "learning_rate": (0.0, math.inf),
    "gamma": (0.0, 1.0),
    "gae_lambda": (0.0, 1.0),
    "greedy_prob": (0.0, 1.0),
    "ent_coef": (0.0, math.inf),
    "log_std_init": (-20.0, 2.0),
    "log_std_final": (-20.0, 2.0),
}
"""Smallest and largest value of arguments; the other integers are at least 1, the other numbers above 0."""

OPTIONAL_ARGUMENTS = ("num_levels",)
"""Arguments that are checked elsewhere."""


def check_types(config_class: type[Any], values: dict[str, Any]) -> Any:
    """Return a configuration of values such as a JSON file holds, or raise a ValueError that names the faulty one."""
    try:
        return TypeAdapter(config_class).validate_python(values)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        name = ".".join(map(str, fault["loc"])) or "configuration"
        raise ValueError(f"{name}: {fault['msg'].lower()}, received {fault['input']!r:.60}.") from error


def check_ranges(config: Any) -> None:
    """Raise a ValueError that names the first number of a configuration that is out of its range."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        values = value if isinstance(value, tuple) and field.name == "net_arch" else (value,)
        for number in values:
            if isinstance(number, bool) or not isinstance(number, (int, float)) or field.name in OPTIONAL_ARGUMENTS:
                continue
            low, high = RANGES.get(field.name, (1, math.inf) if isinstance(number, int) else (0.0, math.inf))
            is_open = field.name not in RANGES and isinstance(number, float)
            if not (math.isfinite(number) and low <= number <= high) or (is_open and number == 0.0):
                expected = f"above {low:g}" if is_open else f"at least {low:g}"
                limit = "" if math.isinf(high) else f" and at most {high:g}"
                raise ValueError(f"{field.name}: expected a number {expected}{limit}, received {value!r:.60}.")
