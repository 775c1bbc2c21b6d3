"""The film of a policy that plays a hole."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from minigolf_env._validation import integer, one_of
from minigolf_env.envs import MiniGolfEnv, round_reset_options
from minigolf_env.players.policies import Policy, load_policy
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
    """Film a policy that plays a hole, and print a line about the file; a progress bar shows how far it is.

    Args:
        output: the file, .mp4 or .gif.
        course: as for MiniGolfEnv; of "round", the episodes are the holes in turn.
        policy: as for ``policies.load_policy``.
        difficulty: of levels, as for MiniGolfEnv.
        episodes: how many are played, at least 1.
        seed: of the first episode and the random policy; the next episode's is one more.
        camera: a name of ``rendering.CAMERA_NAMES``.
        size: width and height, pixels.
        fps: pictures a second.
        profile: a name of ``rendering.RENDER_PROFILES``.

    Raises:
        ValueError: an argument is not what it should be; nothing was computed then.
        FileNotFoundError, ImportError: as for ``policies.load_policy``.
        OSError: the file cannot be written.
        RenderingError: there is no OpenGL here.
    """
    started = time.perf_counter()
    path = check_path(output)
    fps, size = check_fps(fps, path), check_size(size, "size")
    integer(episodes, "episodes", 1, 1000, "one has several putts.")
    integer(seed, "seed", 0, 2**63, "0 will do.")
    one_of(profile, RENDER_PROFILES, "profile")
    player = load_policy(policy, seed)
    look: dict[str, Any] = {"render_size": size, "camera": camera, "render_profile": profile}
    look |= {"observation": player.observation, "difficulty": difficulty}
    # Each episode has its own environment, which remembers its putts: what is to be drawn is known before it is drawn.
    stages = [MiniGolfEnv(course, "rgb_array_list", **look) for _ in range(episodes)]
    playing = tqdm(stages, "Playing", leave=False, disable=None)
    shows = [_play(env, player, seed + k, round_reset_options(course, k), fps) for k, env in enumerate(playing)]
    with VideoWriter(path, size, fps) as writer:
        _draw(stages, writer, sum(show.pictures for show in shows))
    print(
        f"{output}: {writer.num_frames / fps:.1f} s of {size[0]} x {size[1]}, {path.stat().st_size / 1e6:.2f} MB, "
        f"strokes: {', '.join(map(str, shows))}; took {time.perf_counter() - started:.0f} s"
    )


class _Show(NamedTuple):
    """What an episode came to."""

    strokes: int
    holed: bool
    pictures: int

    def __str__(self) -> str:
        return f"{self.strokes}" if self.holed else f"{self.strokes} (not holed)"


def _play(env: MiniGolfEnv, player: Policy, seed: int, options: dict[str, int], fps: int) -> _Show:
    observation, info = env.reset(seed=seed, options=options)
    over, pictures = False, 1
    while not over:
        observation, _, over, _, info = env.step(player.act(observation, env))
        pictures += frame_count(info["shot_time"], fps)
    return _Show(info["strokes"], info["is_success"], pictures)


def _draw(stages: list[MiniGolfEnv], writer: VideoWriter, total: int) -> None:
    with tqdm(total=total, desc="Filming", leave=False, disable=None) as bar:
        for env in stages:
            for picture in env.renderer.iter_frames(writer.fps):
                writer.add(picture)
                bar.update()
