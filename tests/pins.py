"""Versions that constraint files pin."""

from __future__ import annotations

import re
from pathlib import Path

from packaging.utils import canonicalize_name


def read_pins(path: Path) -> dict[str, str]:
    """Return the version in each line such as "numpy==2.4.6" of a file, by canonical package name."""
    lines = re.findall(r"^([\w.-]+)==([^\s;]+)", path.read_text(), re.MULTILINE)
    return {canonicalize_name(name): version for name, version in lines}
