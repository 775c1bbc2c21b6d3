"""Record a video of a policy that plays a hole, a round or levels."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from minigolf_env._validation import integer, one_of
from minigolf_env.envs import MiniGolfEnv, round_reset_options
from minigolf_env.envs.config import ignore_unseen_levels
from minigolf_env.players.policies import Policy, load_policy, warn_if_untrained
from minigolf_env.rendering import RENDER_PROFILES, check_size, frame_count
from minigolf_env.rendering.video_writer import VideoWriter, check_fps, check_path


def record_policy(
    output: str | Path,
    course: str = "dogleg",
    policy: str | Path = "search",
    *,
    difficulty: str | None = None,
    episodes: int = 1,
    seed: int = 0,
    camera: str = "follow",
    size: tuple[int, int] = (640, 480),
    fps: int = 30,
    profile: str = "high",
) -> None:
    """Record a video of a policy that plays, with a progress bar, and print a line about the file.

    Args:
        output: the file, .mp4 or .gif.
        course: the ``course`` of MiniGolfEnv. The episodes of "round" are its holes in turn.
        policy: the ``name`` of ``policies.load_policy``.
        difficulty: the ``difficulty`` of MiniGolfEnv, for levels.
        episodes: number of episodes, at least 1.
        seed: seed of the first episode and of the random policy; episode k has the seed ``seed + k``.
        camera: a name of ``rendering.CAMERA_NAMES``.
        size: width and height, pixels.
        fps: frames per second.
        profile: a name of ``rendering.RENDER_PROFILES``.

    Raises:
        ValueError: an argument is invalid; nothing was computed then.
        FileNotFoundError, ImportError: as ``policies.load_policy``.
        OSError: the file cannot be written.
        RenderingError: there is no OpenGL.
    """
    started = time.perf_counter()
    path = check_path(output)
    fps = check_fps(fps, path)
    size = check_size(size, "size")
    integer(episodes, "episodes", 1, 1000, "one has several putts.")
    integer(seed, "seed", 0, 2**63, "0 will do.")
    one_of(profile, RENDER_PROFILES, "profile")
    player = load_policy(policy, seed)
    env_args: dict[str, Any] = {"render_size": size, "camera": camera, "render_profile": profile}
    env_args |= {"observation": player.observation, "difficulty": difficulty}
    # Play all episodes before drawing, each in an environment that keeps its putts: the progress bar then has a total.
    warn_if_untrained(player, course)
    with ignore_unseen_levels():
        envs = [MiniGolfEnv(course, "rgb_array_list", **env_args) for _ in range(episodes)]
    progress = tqdm(envs, "Playing", leave=False, disable=None)
    results = [_play(env, player, seed + k, round_reset_options(course, k), fps) for k, env in enumerate(progress)]
    # Draw them.
    with VideoWriter(path, size, fps) as writer:
        _draw(envs, writer, sum(episode.num_frames for episode in results))
    print(
        f"{output}: {writer.num_frames / fps:.1f} s of {size[0]} x {size[1]}, {path.stat().st_size / 1e6:.2f} MB, "
        f"strokes: {', '.join(map(str, results))}; took {time.perf_counter() - started:.0f} s"
    )


class _PlayedEpisode(NamedTuple):
    """The result of an episode."""

    strokes: int
    """Number of strokes."""
    holed: bool
    """True if the ball ended in the cup."""
    num_frames: int
    """Number of frames of its video."""

    def __str__(self) -> str:
        return f"{self.strokes}" if self.holed else f"{self.strokes} (not holed)"


def _play(env: MiniGolfEnv, player: Policy, seed: int, options: dict[str, int], fps: int) -> _PlayedEpisode:
    observation, info = env.reset(seed=seed, options=options)
    done = False
    num_frames = 1
    while not done:
        observation, _, done, _, info = env.step(player.act(observation, env))
        num_frames += frame_count(info["shot_time"], fps)
    return _PlayedEpisode(info["strokes"], info["is_success"], num_frames)


def _draw(envs: list[MiniGolfEnv], writer: VideoWriter, total: int) -> None:
    with tqdm(total=total, desc="Drawing", leave=False, disable=None) as bar:
        for env in envs:
            for frame in env.renderer.iter_frames(writer.fps):
                writer.add(frame)
                bar.update()
