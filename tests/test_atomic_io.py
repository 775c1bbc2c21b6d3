"""A file is whole or not there, whatever happens while it is written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from minigolf_env._atomic_io import atomic_write, check_output, commit, write_text


@pytest.mark.parametrize("before", [None, "what was there"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_is_broken_off_leaves_no_trace(tmp_path: Path, before: str | None, error: type[BaseException]) -> None:
    """What was there stays, and nothing lies beside it."""
    path = tmp_path / "a.json"
    if before is not None:
        path.write_text(before)
    with pytest.raises(error), atomic_write(path) as part:
        part.write_text("half")
        raise error
    assert [file.read_text() for file in tmp_path.iterdir()] == ([] if before is None else [before])


def test_a_file_is_replaced_at_the_end(tmp_path: Path) -> None:
    """Not before; its folder is made, its ending kept, and its permissions are those of any new file."""
    path, plain = tmp_path / "new" / "a.json", tmp_path / "plain"
    plain.touch()
    for text in ("one", "two"):
        with atomic_write(path) as part:
            part.write_text(text)
            assert not path.exists() or path.read_text() == "one"
            assert (part.parent, part.suffix) == (path.parent, ".json")
        assert path.read_text() == text and [file.name for file in path.parent.iterdir()] == ["a.json"]
    assert path.stat().st_mode == plain.stat().st_mode


def test_a_link_is_written_through(tmp_path: Path) -> None:
    """Whoever keeps results elsewhere keeps them there."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere" / "a.txt")
    write_text(tmp_path / "link", "through")
    assert (tmp_path / "elsewhere" / "a.txt").read_text() == "through" and (tmp_path / "link").is_symlink()


def test_nothing_is_begun_that_cannot_be_written(tmp_path: Path) -> None:
    """A folder in its place, or a file where its folder would be."""
    (tmp_path / "file").touch()
    refused = {tmp_path: "something else of that name", tmp_path / "file" / "a": "choose another folder"}
    for path, message in refused.items():
        with pytest.raises(OSError, match=message), atomic_write(path):
            pytest.fail("the block was entered")
        with pytest.raises(OSError, match=message):
            check_output(path)


def test_a_folder_is_moved_once_it_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of its files are synced before its name appears, and the name after it."""
    beside, place = tmp_path / ".part", tmp_path / "part"
    (beside / "deep").mkdir(parents=True)
    for name in ("a", "deep/b"):
        (beside / name).write_text(name)
    seen: list[bool] = []
    monkeypatch.setattr(os, "fsync", lambda _: seen.append(place.exists()))
    commit(beside, place)
    assert seen == [False, False, True] and (place / "deep" / "b").read_text() == "deep/b"
