"""The licences of all dependencies are listed for the pinned versions and compatible with ours."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tests.pins import read_pins

ROOT = Path(__file__).parents[1]

HINT = "write the page again with `make licences`"

PERMISSIVE = ("0BSD", "3-Clause BSD", "Apache", "BSD", "BSL-1.0", "CC0", "ISC", "MIT", "PSF", "Python Software", "Zlib")
"""First words of licences that only ask for attribution."""

FILE_BY_FILE = ("MPL-2.0", "Mozilla Public License 2.0")
"""Licences that only ask those who change the library's own files to publish the changes."""

LICENCE_EXCEPTIONS = ("LLVM-exception",)
"""Additional permissions, named in a licence expression."""

LICENCES_NOT_IN_METADATA = {"pyglet": "BSD-3-Clause, in its LICENSE"}
"""Licences of packages whose metadata have none."""

PINNED = read_pins(ROOT / "constraints.txt")


def licences() -> dict[str, tuple[str, str]]:
    """Return version and licence of each package in docs/licences.md."""
    rows = [line.split("|")[1:-1] for line in (ROOT / "docs" / "licences.md").read_text().splitlines() if "|" in line]
    return {canonicalize_name(name.strip()): (version.strip(), licence.strip()) for name, version, licence in rows[2:]}


def test_licences_of_all_pinned_versions_are_listed() -> None:
    """The page has each package of constraints.txt at its pinned version."""
    assert {name: version.partition("+")[0] for name, (version, _) in licences().items()} == PINNED, HINT


@pytest.mark.parametrize("name", PINNED)
def test_licence_is_permissive_or_file_by_file(name: str) -> None:
    """Each part of the licence expression asks nothing of those who only use the library."""
    licence = licences()[name][1]
    expression = LICENCES_NOT_IN_METADATA.get(name, licence) if licence == "UNKNOWN" else licence
    parts = re.split(r"\s+(?:AND|OR|WITH)\s+|;\s*", expression)
    allowed = PERMISSIVE + FILE_BY_FILE + LICENCE_EXCEPTIONS
    assert all(part.startswith(allowed) for part in parts), f"{name}: {licence}"
