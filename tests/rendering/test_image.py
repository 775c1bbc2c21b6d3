"""Grids of images, and videos of a batch."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import minigolf_env  # noqa: F401 (registers the environments)
from minigolf_env.rendering import PAUSE_AFTER_PUTT, RENDER_FPS, Image, tile, tile_sequences

SIZE = (64, 48)
PUTT = np.array([0.5, 0.1], np.float32)
WEAK_PUTT = np.array([0.1, 0.0], np.float32)


def numbered_images(n: int, height: int = 2, width: int = 2) -> list[Image]:
    """Return n images; all values of the first are 1, of the second 2, and so on."""
    return [np.full((height, width, 3), k + 1, np.uint8) for k in range(n)]


def make_batch(num_envs: int, **options: Any) -> Any:
    """Return a batch whose episodes have two putts, which renders lists of frames."""
    look: dict[str, Any] = {"render_size": SIZE, "camera": "top", "render_profile": "fast"}
    return gym.make_vec(
        "MiniGolf-v0", num_envs=num_envs, render_mode="rgb_array_list", max_strokes=2, **look, **options
    )


def num_frames(shot_time: float) -> int:
    """Return the number of frames of a putt."""
    return math.ceil((shot_time + PAUSE_AFTER_PUTT) * RENDER_FPS)


def test_tile_fills_rows_and_chooses_the_closest_aspect() -> None:
    """The grid is nearly square by default; unused cells are black."""
    grid = tile(numbered_images(3))
    assert grid[::2, ::2, 0].tolist() == [[1, 2], [3, 0]]
    shapes = {n: tile(numbered_images(n)).shape[:2] for n in (1, 2, 4, 9, 16)}
    assert shapes[1] == (2, 2) and shapes[4] == (4, 4) and shapes[9] == (6, 6) and shapes[16] == (8, 8)
    assert tile(numbered_images(4), aspect=4.0).shape == (2, 8, 3)
    assert tile(numbered_images(4), aspect=0.25).shape == (8, 2, 3)
    assert tile(numbered_images(2, 48, 64), aspect=2.6).shape == (48, 128, 3)


def test_tile_rejects_no_images_and_different_sizes() -> None:
    """No images, or images of different sizes, are an error that says what was expected."""
    with pytest.raises(ValueError, match="at least one"):
        tile([])
    with pytest.raises(ValueError, match="one size"):
        tile([*numbered_images(1), *numbered_images(1, 3)])


@pytest.mark.parametrize(
    ("image", "message"),
    [
        ([[[0, 0, 0]]], r"an array \(height, width, 3\), received \[\[\[0, 0, 0\]\]\]"),
        (None, "received None"),
        (np.zeros((0, 2, 3), np.uint8), r"received uint8 of \(0, 2, 3\)"),
        (np.zeros((2, 0, 3), np.uint8), r"received uint8 of \(2, 0, 3\)"),
        (np.zeros((2, 2), np.uint8), r"received uint8 of \(2, 2\)"),
        (np.zeros((2, 2, 4), np.uint8), r"received uint8 of \(2, 2, 4\)"),
        (np.zeros((2, 2, 3)), r"received float64 of \(2, 2, 3\)"),
    ],
)
def test_tile_rejects_what_is_no_image(image: Any, message: str) -> None:
    """The message has the index; a sequence of such frames is an error as well."""
    with pytest.raises(ValueError, match=r"images\[1\]: expected .*" + message):
        tile([*numbered_images(1), image])
    with pytest.raises(ValueError, match=r"images\[0\]: expected .*" + message):
        list(tile_sequences([[image]]))


@pytest.mark.parametrize("aspect", [0.0, -1.0, float("nan"), float("inf"), "wide"])
def test_tile_rejects_impossible_aspects(aspect: Any) -> None:
    """Not with an error of the logarithm."""
    with pytest.raises(ValueError, match="aspect: expected"):
        tile(numbered_images(2), aspect)


def test_tile_takes_arrays_of_images() -> None:
    """An array (N, height, width, 3) is as good as a list, and so is one of frames."""
    images = np.array(numbered_images(4))
    assert np.array_equal(tile(images), tile(numbered_images(4)))  # type: ignore[arg-type]
    grids = zip(tile_sequences([images]), tile_sequences([numbered_images(4)]), strict=True)  # type: ignore[list-item]
    assert all(np.array_equal(first, second) for first, second in grids)


def test_tile_sequences_repeats_the_last_frame_of_shorter_sequences() -> None:
    """The result is as long as the longest sequence; empty sequences are an error."""
    first, second, third = numbered_images(3)
    grids = list(tile_sequences([[first, second, third], [third]], aspect=2.0))
    assert [grid[0, ::2, 0].tolist() for grid in grids] == [[1, 3], [2, 3], [3, 3]]
    with pytest.raises(ValueError, match=r"at least one frame in each, received \[1, 0\]"):
        list(tile_sequences([[first], []]))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_batch_video_has_every_putt_in_all_autoreset_modes(mode: str, gl: None) -> None:
    """A step has as many frames as its longest putt, and one of a reset; the last putt of an episode is included."""
    envs = make_batch(3, autoreset_mode=mode)
    envs.reset(seed=0)
    assert len(list(tile_sequences(envs.render()))) == 1
    over = np.zeros(3, np.bool_)
    for _ in range(5):
        num_resets = over.astype(int) if mode != "SameStep" else np.zeros(3, int)
        if mode == "Disabled" and over.any():
            envs.reset(options={"reset_mask": over})
        *_, over, _, info = envs.step(np.stack([PUTT, WEAK_PUTT, -PUTT]))
        if mode == "SameStep":
            num_resets += over
        shot_times = np.where(over, info.get("final_info", info)["shot_time"], info["shot_time"])
        expected = [num_frames(time) * (time > 0.0) + n for time, n in zip(shot_times, num_resets, strict=True)]
        sequences = envs.render()
        assert [len(sequence) for sequence in sequences] == expected
        assert len(list(tile_sequences(sequences))) == max(expected)


def test_shorter_putts_of_a_batch_keep_their_last_frame(gl: None) -> None:
    """Cells are in the order of the environments; the short putt's cell stays as it ended, the fourth is black."""
    envs = make_batch(3, tee="fixed")
    envs.reset(seed=0)
    envs.render()
    info = envs.step(np.stack([PUTT, WEAK_PUTT, PUTT]))[-1]
    short, long = num_frames(info["shot_time"][1]), num_frames(info["shot_time"][0])
    assert short < long - 5
    lists = envs.render()
    video = np.array(list(tile_sequences(lists)), dtype=float)
    assert video.shape == (long, 2 * SIZE[1], 2 * SIZE[0], 3)
    left, right = video[:, :48, :64], video[:, :48, 64:]
    assert np.abs(np.diff(left[short + 2 : -5], axis=0)).max() > 20.0, "the long putt continues"
    np.testing.assert_array_equal(right[short:], np.broadcast_to(lists[1][-1], right[short:].shape))
    assert not video[:, 48:, 64:].any()
