"""Where everything comes from: the lock file, the bill of materials and the licences are those of constraints.txt."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from packaging.utils import canonicalize_name

from tests.pins import pins, read_pins

ROOT = Path(__file__).parents[1]

REMEDY = "write them anew with `make supply`"

PERMISSIVE = ("0BSD", "3-Clause BSD", "Apache", "BSD", "BSL-1.0", "CC0", "ISC", "MIT", "PSF", "Python Software", "Zlib")
"""How the names of licences begin that ask for no more than to be named."""

FILE_BY_FILE = ("MPL-2.0", "Mozilla Public License 2.0")
"""MPL: it asks those who change the library's own files to publish them, nothing of those who use it."""

EXCEPTIONS = ("LLVM-exception",)
"""What a licence allows beyond itself."""

UNSAID = {"pyglet": "BSD-3-Clause, in its LICENSE"}
"""What those are under who do not say so in their metadata."""


TESTED = read_pins(ROOT / "constraints.txt")


def test_the_lock_file_has_the_tested_versions_and_a_hash_of_each() -> None:
    """Beside them only what other systems need."""
    text = (ROOT / "requirements.lock").read_text()
    locked = pins(text)
    assert {name: locked.get(name) for name in TESTED} == TESTED, REMEDY
    entries = re.split(r"^(?=\w)", text, flags=re.MULTILINE)[1:]
    assert len(entries) == len(locked) and all("--hash=sha256:" in entry for entry in entries)
    extra = [entry for entry in entries if not pins(entry).keys() & TESTED.keys()]
    assert all(";" in entry.splitlines()[0] for entry in extra), REMEDY
    assert "://" not in text and "file:" not in text, "an address of somebody's mirror"


def test_the_bill_of_materials_is_of_the_tested_versions() -> None:
    """No more, no less."""
    bom = json.loads((ROOT / "sbom.cdx.json").read_text())
    listed = {canonicalize_name(part["name"]): part["version"].partition("+")[0] for part in bom["components"]}
    assert {name: version for name, version in listed.items() if name != "pip"} == TESTED, REMEDY
    assert bom["metadata"]["component"]["name"] == "minigolf-env"


def licences() -> dict[str, tuple[str, str]]:
    """Return version and licence of each package in docs/licences.md."""
    rows = [line.split("|")[1:-1] for line in (ROOT / "docs" / "licences.md").read_text().splitlines() if "|" in line]
    return {canonicalize_name(name.strip()): (version.strip(), licence.strip()) for name, version, licence in rows[2:]}


def test_all_licences_are_listed() -> None:
    """Of the tested versions."""
    assert {name: version.partition("+")[0] for name, (version, _) in licences().items()} == TESTED, REMEDY


@pytest.mark.parametrize("name", TESTED)
def test_a_licence_is_compatible(name: str) -> None:
    """Each part of it asks nothing of those who use the library."""
    licence = licences()[name][1]
    said = UNSAID.get(name, licence) if licence == "UNKNOWN" else licence
    parts = re.split(r"\s+(?:AND|OR|WITH)\s+|;\s*", said)
    assert all(part.startswith(PERMISSIVE + FILE_BY_FILE + EXCEPTIONS) for part in parts), f"{name}: {licence}"
