"""RecordVideo: videos of episodes in which every putt is seen from beginning to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym

from minigolf_env.envs import MiniGolfEnv
from minigolf_env.envs.minigolf import Action, Observation
from minigolf_env.wrappers.recorder import RECORDABLE, Recorder, Trigger


class RecordVideo(gym.Wrapper[Observation, Action, Observation, Action], gym.utils.RecordConstructorArgs):
    """Records videos of episodes as ``gymnasium.wrappers.RecordVideo`` does, but of each putt all pictures.

    A step of MiniGolf-v0 is a whole putt, of which Gymnasium's wrapper keeps one picture. The files are named the same,
    ``rl-video-episode-0.mp4`` or ``rl-video-step-0.mp4``; ``render()`` is not disturbed, and nothing is drawn for steps
    that are not recorded. Pictures go to the file as they are drawn. ``close()`` finishes the last video.

    Args:
        env: MiniGolf-v0, perhaps wrapped, with a render mode that makes pictures.
        video_folder: where the videos go; made if it is not there.
        episode_trigger: says of the n-th episode, from 0, whether a video begins with it.
        step_trigger: says of the n-th step, from 0, over all episodes, whether a video begins with its putt. With
            neither, videos are of episodes 0, 1, 8, 27, ... 1000, 2000, ...
        video_length: pictures in a video, which then goes on over episodes; 0: up to the end of the episode.
        name_prefix: of the files' names.
        fps: pictures a second; None: the environment's 30. Time runs true at any.
        disable_logger: False: each finished video is named on stderr.
        gc_trigger: says after which episode's video to collect garbage.

    Raises:
        ValueError: the environment is another, its render mode makes no pictures, or an argument is not what it should
            be.
        OSError: the folder cannot be made, or a video not be written.
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
        golf = env.unwrapped
        if not isinstance(golf, MiniGolfEnv):
            raise ValueError(
                f"env: expected MiniGolf-v0, perhaps wrapped, received {golf}; "
                "gymnasium.wrappers.RecordVideo records other environments."
            )
        if golf.render_mode not in RECORDABLE:
            raise ValueError(
                f"env: expected a render_mode that makes pictures, one of {RECORDABLE}, received {golf.render_mode!r}; "
                "make the environment with render_mode='rgb_array'."
            )
        if fps is None:
            fps = int(golf.metadata["render_fps"])
        self._recorder = Recorder(
            video_folder, episode_trigger, step_trigger, video_length, name_prefix, fps, disable_logger, gc_trigger
        )
        self._mirror = golf.screen.mirror()

    @property
    def recording(self) -> bool:
        """Whether a video is being recorded."""
        return self._recorder.name is not None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Reset the environment; perhaps a video ends, and one begins with the ball on the tee."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._recorder.next_episode()
        self._capture()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Play a putt; if a video is being recorded or begins, it gets the pictures of the putt."""
        result = self.env.step(action)
        self._recorder.next_step()
        self._capture()
        return result

    def start_recording(self, video_name: str) -> None:
        """Begin a video of that name, without its ending; one that was being recorded ends."""
        self._recorder.start(video_name)

    def stop_recording(self) -> None:
        """Finish the video, if one is being recorded."""
        self._recorder.stop()

    def close(self) -> None:
        """Finish the video and close the environment."""
        try:
            self._recorder.stop()
        finally:
            self.env.close()

    def _capture(self) -> None:
        if self.recording:
            self._recorder.take(self._mirror.film(self._recorder.fps))
        self._mirror.forget()
