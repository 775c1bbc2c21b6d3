"""The README's code runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text()


def test_every_python_block_runs() -> None:
    """The blocks, one after another in one namespace, raise nothing, and end the episode they play."""
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert len(blocks) >= 3
    namespace: dict[str, object] = {}
    for block in blocks:
        exec(block, namespace)  # noqa: S102 (our own README)
    assert namespace["terminated"] is not None and namespace["shot"] is not None
