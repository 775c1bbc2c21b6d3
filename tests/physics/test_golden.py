"""Golden trajectories have the same bits on every machine."""

import pytest

from tests.physics import golden
from tools.determinism import ENV_ID, HINT, load_stored_hashes


@pytest.mark.parametrize("name", golden.SCENES)
def test_golden_trajectories_have_the_stored_hashes(name: str) -> None:
    """No bit of 80 shots has changed since the hashes were stored."""
    assert golden.hash_of(name) == load_stored_hashes()[ENV_ID]["golden"][name], HINT
