"""What constraint and lock files pin."""

from __future__ import annotations

import re
from pathlib import Path

from packaging.utils import canonicalize_name


def read_pins(path: Path) -> dict[str, str]:
    """Return the version that a file pins for each package, by canonical name."""
    return pins(path.read_text())


def pins(text: str) -> dict[str, str]:
    """Return the versions in lines such as "numpy==2.4.6", by canonical name."""
    found = re.findall(r"^([\w.-]+)==([^\s;]+)", text, re.MULTILINE)
    return {canonicalize_name(name): version for name, version in found}
