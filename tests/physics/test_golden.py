"""Golden trajectories: the same bits as ever, on every machine."""

import pytest

from tests.physics import golden
from tools.determinism import ENV_ID, HINT, load_stored_hashes


@pytest.mark.parametrize("name", golden.SCENES)
def test_golden_trajectories_are_the_same_bits(name: str) -> None:
    """Not a bit of 80 shots has changed since the version that wrote the hashes."""
    assert golden.hash_of(name) == load_stored_hashes()[ENV_ID]["golden"][name], HINT
