"""When videos begin and end, and their files: what the recording wrappers share."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterable
from glob import escape
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from minigolf_env._validation import integer
from minigolf_env.rendering.video_writer import VideoWriter, check_fps

Trigger = Callable[[int], bool]
RECORDABLE = ("rgb_array", "rgb_array_list")


def cubes(episode: int) -> bool:
    """Return whether an episode is 0, 1, 8, 27, ... 1000, 2000, ... as Gymnasium, whose module asks for moviepy."""
    return round(episode ** (1 / 3)) ** 3 == episode if episode < 1000 else episode % 1000 == 0


class Recorder:
    """Writes pictures to one video after another in a folder, as Gymnasium's RecordVideo names and times them.

    Args:
        folder: where the videos go; made if it is not there.
        episode_trigger: says of the n-th episode, from 0, whether a video begins with it.
        step_trigger: says of the n-th step, from 0, over all episodes, whether a video begins with it. With neither,
            videos are of episodes 0, 1, 8, 27, ... 1000, 2000, ...
        length: pictures in a video; 0: up to the end of the episode.
        prefix: of the files' names.
        fps: pictures a second.
        quiet: False: each finished video is named on stderr.
        gc_trigger: says after which episode's video to collect garbage.

    Raises:
        ValueError: length or fps is not what it should be.
        OSError: the folder cannot be made, or a video not be written.
    """

    def __init__(
        self,
        folder: str | Path,
        episode_trigger: Trigger | None,
        step_trigger: Trigger | None,
        length: int,
        prefix: str,
        fps: int,
        quiet: bool,
        gc_trigger: Trigger | None,
    ) -> None:
        integer(length, "video_length", 0, hint="give a number of pictures, or 0 for whole episodes.")
        if episode_trigger is None and step_trigger is None:
            episode_trigger = cubes
        self.folder = Path(folder).expanduser().absolute()
        self.fps = check_fps(fps, Path(".mp4"))
        self.episode = self.step = -1
        self.name: str | None = None
        """Of the video that is being recorded."""
        self._triggers = episode_trigger, step_trigger, gc_trigger
        self._length, self._prefix, self._quiet = length, prefix, quiet
        self._writer: VideoWriter | None = None
        self.folder.mkdir(parents=True, exist_ok=True)
        if any(self.folder.glob(f"{escape(prefix)}-*.mp4")):
            gym.logger.warn(f"{self.folder} has videos named {prefix}-*.mp4, which new ones replace.")

    def next_episode(self) -> None:
        """Say that an episode has ended and the next begins."""
        self.episode += 1
        if self._length == 0:
            self.stop()
        trigger = self._triggers[0]
        if trigger is not None and trigger(self.episode):
            self.start(f"{self._prefix}-episode-{self.episode}")

    def next_step(self) -> None:
        """Say that a step was made, whose pictures are next."""
        self.step += 1
        trigger = self._triggers[1]
        if trigger is not None and trigger(self.step):
            self.start(f"{self._prefix}-step-{self.step}")

    def start(self, name: str) -> None:
        """Begin a video of that name, without its ending; one that was being recorded ends."""
        self.stop()
        self.name = name

    def stop(self) -> None:
        """Finish the video, if one is being recorded."""
        writer, self._writer, self.name = self._writer, None, None
        if writer is None:
            return
        writer.close()
        if not self._quiet:
            print(f"{writer.path}: {writer.pictures / writer.fps:.1f} s", file=sys.stderr)
        trigger = self._triggers[2]
        if trigger is not None and trigger(self.episode):
            gc.collect()

    def take(self, pictures: Iterable[NDArray[np.uint8]]) -> None:
        """Add pictures (height, width, 3) to the video until it is full; none is asked for that is not recorded."""
        try:
            for picture in pictures:
                self._add(picture)
                if self.name is None:
                    return
        except BaseException:
            if self._writer is None or not self._writer.discard.alive:  # It failed, so this video is over.
                self._writer = self.name = None
            raise

    def _add(self, picture: NDArray[np.uint8]) -> None:
        if self._writer is None:
            height, width, _ = picture.shape
            self._writer = VideoWriter(self.folder / f"{self.name}.mp4", (width, height), self.fps)
        self._writer.add(picture)
        if 0 < self._length <= self._writer.pictures:
            self.stop()

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy starts with: it goes on counting, and does not record."""
        return {**self.__dict__, "_writer": None, "name": None}

    def __del__(self) -> None:
        writer = getattr(self, "_writer", None)
        if writer is not None and writer.process == os.getpid():  # To a fork it is not lost: its parent has it.
            gym.logger.warn(f"The video {self.name} was not finished and is lost: call close() on the environment.")
