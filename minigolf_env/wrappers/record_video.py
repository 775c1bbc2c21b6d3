"""RecordVideo, a wrapper that records videos of episodes with all frames of each putt."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from glob import escape
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym

from minigolf_env._atomic_io import check_output_folder
from minigolf_env._validation import integer, quote
from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.minigolf import Action, Observation
from minigolf_env.rendering import Image
from minigolf_env.rendering.video_writer import VideoWriter, check_fps

Trigger = Callable[[int], bool]
"""Function of the number of an episode or a step, from 0."""

RECORDABLE_MODES = ("rgb_array", "rgb_array_list")
"""Render modes whose episodes can be recorded."""


def capped_cubic_schedule(episode: int) -> bool:
    """Return whether an episode is 0, 1, 8, 27, ... 1000, 2000, ...

    This is Gymnasium's default schedule; Gymnasium's own function cannot be imported without moviepy.
    """
    return round(episode ** (1 / 3)) ** 3 == episode if episode < 1000 else episode % 1000 == 0


class RecordVideo(gym.Wrapper[Observation, Action, Observation, Action], gym.utils.RecordConstructorArgs):
    """Records videos of episodes as ``gymnasium.wrappers.RecordVideo`` does, with all frames of each putt.

    A step of MiniGolf-v0 is a whole putt, of which Gymnasium's wrapper records one frame. The files have the same
    names, ``rl-video-episode-0.mp4`` or ``rl-video-step-0.mp4``. ``render()`` returns what it does without the wrapper.
    Nothing is drawn for steps that are not recorded. Frames are written as they are drawn; ``close()`` finishes the
    last video. A copy of the wrapper continues to count episodes and steps, and does not record.

    For a batch, ``minigolf_env.rendering.tile_sequences`` puts the frames of all environments side by side.

    Args:
        env: MiniGolf-v0, possibly wrapped, with render_mode "rgb_array" or "rgb_array_list".
        video_folder: folder of the videos; it is created if it does not exist.
        episode_trigger: function of the episode's number, from 0: whether a video begins with this episode.
        step_trigger: function of the step's number, from 0 over all episodes: whether a video begins with this step.
            With neither trigger, episodes 0, 1, 8, 27, ... 1000, 2000, ... are recorded.
        video_length: number of frames in a video, which then continues over episodes; 0: up to the end of the episode.
        name_prefix: beginning of the files' names.
        fps: frames per second; None: the environment's 30. Videos play in real time at any value.
        disable_logger: False: print the path of each finished video to stderr.
        gc_trigger: function of the episode's number: whether to collect garbage after its video.

    Raises:
        ValueError: the environment is not MiniGolf-v0, its render mode returns no images, or an argument is invalid.
        OSError: the folder cannot be created, or a video cannot be written.
    """

    def __init__(
        self,
        env: gym.Env[Observation, Action],
        video_folder: str | Path,
        episode_trigger: Trigger | None = None,
        step_trigger: Trigger | None = None,
        video_length: int = 0,
        name_prefix: str = "rl-video",
        fps: int | None = None,
        disable_logger: bool = True,
        gc_trigger: Trigger | None = None,
    ) -> None:
        gym.utils.RecordConstructorArgs.__init__(
            self,
            video_folder=video_folder,
            episode_trigger=episode_trigger,
            step_trigger=step_trigger,
            video_length=video_length,
            name_prefix=name_prefix,
            fps=fps,
            disable_logger=disable_logger,
            gc_trigger=gc_trigger,
        )
        gym.Wrapper.__init__(self, env)
        base_env = _require_minigolf(env)
        # Check the arguments before anything is written.
        integer(video_length, "video_length", 0, hint="give a number of frames, or 0 for whole episodes.")
        self.fps = check_fps(int(base_env.metadata["render_fps"]) if fps is None else fps, Path(".mp4"))
        _require_file_name(name_prefix, "name_prefix")
        self._folder = check_output_folder(video_folder, "video_folder")
        if episode_trigger is None and step_trigger is None:
            episode_trigger = capped_cubic_schedule
        self._episode_trigger = episode_trigger
        self._step_trigger = step_trigger
        self._gc_trigger = gc_trigger
        self._video_length = video_length
        self._name_prefix = name_prefix
        self._is_quiet = disable_logger
        self._episode = -1
        self._step = -1
        self._video_name: str | None = None
        self._writer: VideoWriter | None = None
        self._folder.mkdir(parents=True, exist_ok=True)
        if any(self._folder.glob(f"{escape(name_prefix)}-*.mp4")):
            gym.logger.warn(f"{self._folder} has videos named {name_prefix}-*.mp4, which new ones replace.")
        # A separate renderer receives the same putts as that of the environment.
        self._renderer = base_env.renderer.subscribe()

    @property
    def recording(self) -> bool:
        """Return whether a video is being recorded."""
        return self._video_name is not None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Reset the environment; end the episode's video, and begin another if the trigger asks for it."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._episode += 1
        if self._video_length == 0:
            self.stop_recording()
        if self._episode_trigger is not None and self._episode_trigger(self._episode):
            self.start_recording(f"{self._name_prefix}-episode-{self._episode}")
        self._capture()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Play a putt, and record its frames if a video is being recorded or begins with it."""
        result = self.env.step(action)
        self._step += 1
        if self._step_trigger is not None and self._step_trigger(self._step):
            self.start_recording(f"{self._name_prefix}-step-{self._step}")
        self._capture()
        return result

    def start_recording(self, video_name: str) -> None:
        """Begin a video of a name, without its suffix; a video that is being recorded ends.

        Raises:
            ValueError: the name is that of a file in another folder.
        """
        _require_file_name(video_name, "video_name")
        self.stop_recording()
        self._video_name = video_name

    def stop_recording(self) -> None:
        """Finish the video, if one is being recorded."""
        writer, self._writer = self._writer, None
        self._video_name = None
        if writer is None:
            return
        writer.close()
        if not self._is_quiet:
            print(f"{writer.path}: {writer.num_frames / writer.fps:.1f} s", file=sys.stderr)
        if self._gc_trigger is not None and self._gc_trigger(self._episode):
            gc.collect()

    def close(self) -> None:
        """Finish the video and close the environment."""
        try:
            self.stop_recording()
        finally:
            self.env.close()

    def _capture(self) -> None:
        """Add the frames of the last step to the video, until that has its length; drop them without a video."""
        try:
            for frame in self._renderer.iter_frames(self.fps) if self.recording else ():
                self._add_frame(frame)
                if not self.recording:
                    break
        except BaseException:
            # A video whose writer failed has ended.
            if self._writer is None or not self._writer.discard.alive:
                self._writer = None
                self._video_name = None
            raise
        self._renderer.skip()

    def _add_frame(self, frame: Image) -> None:
        """Add a frame to the video, whose file is opened at the first."""
        if self._writer is None:
            height, width, _ = frame.shape
            self._writer = VideoWriter(self._folder / f"{self._video_name}.mp4", (width, height), self.fps)
        self._writer.add(frame)
        if 0 < self._video_length <= self._writer.num_frames:
            self.stop_recording()

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the video: a copy does not record."""
        return {**self.__dict__, "_writer": None, "_video_name": None}

    def __del__(self) -> None:
        """Warn about a video that is lost; a fork loses none, as its parent writes it."""
        writer = self.__dict__.get("_writer")
        if writer is not None and writer.process_id == os.getpid():
            gym.logger.warn(
                f"The video {self._video_name} was not finished and is lost: call close() on the environment."
            )


def _require_file_name(name: str, what: str) -> None:
    """Raise a ValueError unless a name is the beginning of a file's name, without folders."""
    if Path(str(name)).name != name or "\0" in name:
        raise ValueError(
            f"{what}: expected the beginning of a file's name, without folders, received {quote(name)}; "
            "video_folder is the folder of the videos."
        )


def _require_minigolf(env: gym.Env[Observation, Action]) -> MiniGolfEnv:
    """Return the environment without wrappers, or raise a ValueError if it cannot be recorded."""
    base_env = env.unwrapped
    if not isinstance(base_env, MiniGolfEnv):
        raise ValueError(
            f"env: expected MiniGolf-v0, possibly wrapped, received {quote(base_env)}; "
            "gymnasium.wrappers.RecordVideo records other environments."
        )
    if base_env.render_mode not in RECORDABLE_MODES:
        raise ValueError(
            f"env: expected a render_mode that returns images, one of {RECORDABLE_MODES}, "
            f"received {quote(base_env.render_mode)}; make the environment with render_mode='rgb_array'."
        )
    return base_env
