"""Atomic writes: a file is complete or absent, whatever happens while it is written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from minigolf_env._atomic_io import atomic_write, check_output, commit, write_text


@pytest.mark.parametrize("before", [None, "old content"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_interrupted_write_leaves_the_old_file_and_no_temporary_file(
    tmp_path: Path, before: str | None, error: type[BaseException]
) -> None:
    """After an exception the folder holds what it held before."""
    path = tmp_path / "a.json"
    if before is not None:
        path.write_text(before)
    with pytest.raises(error), atomic_write(path) as temporary:
        temporary.write_text("half")
        raise error
    assert [file.read_text() for file in tmp_path.iterdir()] == ([] if before is None else [before])


def test_file_is_replaced_when_the_block_ends(tmp_path: Path) -> None:
    """The folder is created; the temporary file has the same suffix; permissions are those of any new file."""
    path, plain = tmp_path / "new" / "a.json", tmp_path / "plain"
    plain.touch()
    for text in ("one", "two"):
        with atomic_write(path) as temporary:
            temporary.write_text(text)
            assert not path.exists() or path.read_text() == "one"
            assert (temporary.parent, temporary.suffix) == (path.parent, ".json")
        assert path.read_text() == text and [file.name for file in path.parent.iterdir()] == ["a.json"]
    assert path.stat().st_mode == plain.stat().st_mode


def test_symbolic_link_is_followed(tmp_path: Path) -> None:
    """The file that the link points to is written, and the link stays."""
    (tmp_path / "target").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "target" / "a.txt")
    write_text(tmp_path / "link", "text")
    assert (tmp_path / "target" / "a.txt").read_text() == "text" and (tmp_path / "link").is_symlink()


def test_unwritable_path_is_refused_before_the_block(tmp_path: Path) -> None:
    """The path is a folder, its folder is a file, it is a loop of links, or no path at all."""
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    refused = {
        tmp_path: "something else of that name",
        tmp_path / "file" / "a": "choose another folder",
        tmp_path / "loop": "expected a path",
        tmp_path / "loop" / "a": "expected a path",
        tmp_path / "zero\0byte": "expected a path",
    }
    for path, message in refused.items():
        with pytest.raises(OSError, match=message), atomic_write(path):
            pytest.fail("the block was entered")
        with pytest.raises(OSError, match=message):
            check_output(path)


def test_folder_is_renamed_after_its_files_are_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All files are flushed before the rename, and the parent folder after it."""
    temporary = tmp_path / ".temporary"
    target = tmp_path / "target"
    (temporary / "deep").mkdir(parents=True)
    for name in ("a", "deep/b"):
        (temporary / name).write_text(name)
    target_exists: list[bool] = []
    monkeypatch.setattr(os, "fsync", lambda _: target_exists.append(target.exists()))
    commit(temporary, target)
    assert target_exists == [False, False, True] and (target / "deep" / "b").read_text() == "deep/b"
