"""RecordVideo of the vector environment: the putts of all environments side by side."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from minigolf_env.envs import MiniGolfVectorEnv
from minigolf_env.envs.attributes import Actions, Observations
from minigolf_env.envs.vector import Flags
from minigolf_env.rendering import tile
from minigolf_env.wrappers.recorder import RECORDABLE, Recorder, Trigger

Picture = NDArray[np.uint8]


if TYPE_CHECKING:
    Wrapper = VectorWrapper[Observations, Actions, Observations, Actions, NDArray[Any]]
else:
    Wrapper = VectorWrapper  # Generic from Gymnasium 1.3 on only.


class RecordVideo(Wrapper, gym.utils.RecordConstructorArgs):
    """Records videos as ``gymnasium.wrappers.vector.RecordVideo`` does, but of each putt all pictures.

    The pictures of all environments are tiled. A step is as long as its longest putt; where a ball lies before that,
    its last picture stays. Episodes are counted in the first environment, as Gymnasium does. With autoreset "SameStep"
    the putt that ends an episode is seen, unlike there.

    Args:
        env: the vector environment of MiniGolf-v0, perhaps wrapped, with a render mode.
        video_folder: as for ``minigolf_env.wrappers.RecordVideo``.
        video_aspect_ratio: width and height of the whole that the tiles come as close to as they can.
        record_first_only: the first environment alone is recorded.
        episode_trigger, step_trigger, video_length, name_prefix, fps, disable_logger, gc_trigger: as for
            ``minigolf_env.wrappers.RecordVideo``; a picture is one of all environments.

    Raises:
        ValueError, OSError: as for ``minigolf_env.wrappers.RecordVideo``.
    """

    def __init__(
        self,
        env: VectorEnv[Observations, Actions, NDArray[Any]],
        video_folder: str | Path,
        video_aspect_ratio: tuple[int, int] = (1, 1),
        record_first_only: bool = False,
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
            video_aspect_ratio=video_aspect_ratio,
            record_first_only=record_first_only,
            episode_trigger=episode_trigger,
            step_trigger=step_trigger,
            video_length=video_length,
            name_prefix=name_prefix,
            fps=fps,
            disable_logger=disable_logger,
            gc_trigger=gc_trigger,
        )
        VectorWrapper.__init__(self, env)
        golf = _golf(env)
        if fps is None:
            fps = int(golf.metadata["render_fps"])
        self._recorder = Recorder(
            video_folder, episode_trigger, step_trigger, video_length, name_prefix, fps, disable_logger, gc_trigger
        )
        self._mirrors = [screen.mirror() for screen in golf.screens[: 1 if record_first_only else None]]
        self._held: dict[int, Picture] = {}
        """The last picture of each environment in this video."""
        self._aspect = video_aspect_ratio[0] / video_aspect_ratio[1]
        self._mode = golf.autoreset_mode
        self._resets_next = False

    @property
    def recording(self) -> bool:
        """Whether a video is being recorded."""
        return self._recorder.name is not None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Reset environments; if the first is one of them, perhaps a video ends and one begins."""
        result = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type] # Gymnasium's lacks the list.
        mask = (options or {}).get("reset_mask")
        if mask is None or mask[0]:
            self._recorder.next_episode()
            self._resets_next = False
        self._capture()
        return result

    def step(self, actions: Actions) -> tuple[Observations, NDArray[Any], Flags, Flags, dict[str, Any]]:
        """Play a putt in every environment; if a video is being recorded or begins, it gets their pictures."""
        result = self.env.step(actions)
        over = bool(result[2][0] or result[3][0])
        if self._resets_next:
            self._recorder.next_episode()
        self._resets_next = over and self._mode == AutoresetMode.NEXT_STEP
        self._recorder.next_step()
        if self._mode == AutoresetMode.SAME_STEP:
            self._capture(until_put=True)
            if over:
                self._recorder.next_episode()
        self._capture()
        return result

    def start_recording(self, video_name: str) -> None:
        """Begin a video of that name, without its ending; one that was being recorded ends."""
        self._recorder.start(video_name)

    def stop_recording(self) -> None:
        """Finish the video, if one is being recorded."""
        self._recorder.stop()

    def close(self, **kwargs: Any) -> None:
        """Finish the video and close the environments."""
        try:
            if hasattr(self, "_recorder"):  # Older Gymnasiums also close what was refused its arguments.
                self._recorder.stop()
        finally:
            self.env.close(**kwargs)

    def _capture(self, until_put: bool = False) -> None:
        """Give to the video what was not seen yet, up to where balls were put on the tee, or all."""
        if self.recording:
            self._recorder.take(self._pictures(until_put))
        if not self.recording:
            self._held.clear()
        for mirror in self._mirrors:
            mirror.forget(until_put)

    def _pictures(self, until_put: bool) -> Iterator[Picture]:
        """Yield tiled pictures until the last environment has no more."""
        films = [mirror.film(self._recorder.fps, until_put) for mirror in self._mirrors]
        while True:
            fresh = [next(film, None) for film in films]
            if all(picture is None for picture in fresh):
                return
            for i, picture in enumerate(fresh):
                if picture is not None:
                    self._held[i] = picture
                elif i not in self._held:
                    self._held[i] = self._mirrors[i].picture()
            yield tile([self._held[i] for i in range(len(films))], self._aspect)


def _golf(env: VectorEnv[Observations, Actions, NDArray[Any]]) -> MiniGolfVectorEnv:
    """Return the environment without wrappers, or raise a ValueError."""
    golf = env.unwrapped
    if not isinstance(golf, MiniGolfVectorEnv):
        raise ValueError(
            f"env: expected MiniGolf-v0's vector environment, perhaps wrapped, received {golf}; make it with "
            "gymnasium.make_vec('MiniGolf-v0'), or record with gymnasium.wrappers.vector.RecordVideo."
        )
    if golf.render_mode not in RECORDABLE:
        raise ValueError(
            f"env: expected a render_mode that makes pictures, one of {RECORDABLE}, received {golf.render_mode!r}; "
            "make the environment with render_mode='rgb_array'."
        )
    return golf
