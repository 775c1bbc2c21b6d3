"""MiniGolf-v0: one putt a step."""

from __future__ import annotations

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from minigolf_env.courses import Course
from minigolf_env.envs.config import (
    EnvOptions,
    build_env_config,
    check_actions,
    check_options,
    check_position,
    check_positions,
)
from minigolf_env.envs.episode_state import decode_state, encode_state, task_index_info
from minigolf_env.envs.task import FloatArray, Outcome, Result, action_space
from minigolf_env.rendering import RENDER_FPS, RENDER_MODES, EpisodeRenderer, RenderContext

Observation = NDArray[Any]
Action = NDArray[np.float32]


class MiniGolfEnv(gym.Env[Observation, Action]):
    """Minigolf on a course of closed triangle meshes, with an exactly simulated ball: one step is one putt.

    ## Action space
    ``Box(-1, 1, (2,), float32)``: the putt vector in the horizontal plane. Its direction is where the ball is struck,
    its length, clipped to 1, the share of the top speed. The step runs the whole putt: until the ball rests, drops into
    the cup or leaves the course.

    ## Observation space
    ``Box(-1, 1, (10,), float32)``:

    | Number | Meaning | Scale |
    |---|---|---|
    | 0, 1, 2 | the ball's x, y, z | -1 and 1 at the course's bounds |
    | 3, 4, 5 | x, y, z of the way from the ball to the cup's rim | 1 is the bounds' diagonal in plan |
    | 6, 7 | horizontal direction to the cup, as long as number 8: a straight putt is a multiple of it | as number 8 |
    | 8 | square root of the horizontal distance to the cup, which the speed it takes goes with | 1 is the diagonal |
    | 9 | strokes left | 1 at the tee, 0 after the last |

    With ``observation="rays"`` it is ``Box(-1, 1, (48,), float32)``: these numbers; the way that the ball has free in
    32 horizontal directions, the first along x, counter-clockwise, 1 is 4 m or more; how far below it the ground is, 1
    is 0.5 m or more; the slope of the ground along x and y; and, in the same scale on every hole, numbers 6 and 7, 1 is
    8 m or more, and the cup's height above the ball, m.

    With ``observation="bounce_rays"`` it is ``Box(-1, 1, (2320,), float32)``: numbers 0 to 9; the ground and cup
    numbers of "rays"; and for each of 96 rays, which follow the ground and are reflected off up to three walls, four
    segments of six numbers each: where the segment ends, x and y from the ball, 1 is 16 m; the wall's normal there, x
    and y; the height of the end and the greatest height so far, m.

    With ``observation="pixels"`` it is ``Box(0, 255, (84, 84, 3), uint8)``: the course from above, x to the right and y
    up, the ball drawn large enough to be seen; the white share of the lowest two rows is the share of strokes left.

    ## Reward
    "strokes": -1 a stroke, so that the return is minus the score. "shaped": the same plus the change of a potential,
    minus (1 + 0.3 a metre along the course to the cup), zero when the episode has ended. Its sum over an episode does
    not depend on the strokes played, so that the best policy is the same, and each stroke learns what it was worth.

    ## Start
    The ball lies in the tee box: at a uniformly random place, or in its middle (``tee="fixed"``).
    ``reset(options={"position": (x, y, z)})`` starts with the ball's centre there.

    With ``course="procedural"`` every episode is played on a level drawn from a set: ``num_levels`` of them from
    ``start_level`` on. Levels outside the set are for tests. ``reset(options={"level": 17})`` plays any level.

    With ``course="round"`` the nine holes of ``minigolf_env.courses.ROUND_HOLES`` are played in turn, an episode
    each, then the first again. A reset with a seed begins with the first; ``reset(options={"hole": 3})`` plays the
    third, and goes on from there.

    ## End
    ``terminated`` when the ball is in the cup, and after ``max_strokes`` (a rule of the game: the strokes left are
    observed). ``truncated`` is always False. The cup is a hole in the floor's mesh; the ball is holed when it rests in
    it, or is below the rim without the energy to come out. A ball out of bounds, or one that does not come to rest
    within 30 s, is put back where it was struck, and the stroke counts.

    ## Info
    ``strokes`` (int) of the episode, ``is_success`` (bool) whether the ball is holed, ``status`` (str) of the last
    stroke: "tee", "rest", "holed", "out_of_bounds" or "time_limit", ``shot_time`` (float, s) and ``bounces`` (int) of
    the last stroke, ``course`` (str), on levels ``level`` (int), and on a round ``hole`` (int), from 1 on. The par of
    what was played is ``minigolf_env.courses.par_of(info["course"])``.

    Args:
        course: a name of ``minigolf_env.courses.list_courses()``; a course file; "round"; "procedural"; or a Course
            with a cup.
        difficulty: of the levels, "easy" (default), "medium" or "hard"; these three go with "procedural" only.
        start_level: the first level of the set, 0 by default.
        num_levels: levels in the set, 500 by default; 0: all there are, 2**31.
        render_mode: None; "rgb_array": ``render()`` returns a picture (height, width, 3), uint8, of where the ball lies
            and how it came there; "rgb_array_list": ``render()`` returns the pictures of all putts since the last call
            or the reset, 30 a second; "human": ``step()`` shows the putt in a window, in real time.
        render_size: width and height of the pictures or the window, pixels.
        camera: "follow" (from behind the ball), "top", "tee" (from behind the tee), "orbit" (turning around the
            course).
        render_profile: "high", with smooth edges; "fast"; or "auto": "high", but "fast" in a window drawn without a
            GPU.
        render_speed: how much faster than real time the window shows a putt.
        reward: "shaped" or "strokes".
        observation: "state", "rays", "bounce_rays" or "pixels".
        max_strokes: strokes after which an episode ends, at least 1.
        tee: "random" or "fixed".
        top_speed: launch speed of a full putt, m/s; None: the course's.
        cup_radius: m; None: the course's.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (share of it), drawn from
            ``np_random``.
        dt: time step of the physics, s.
        impact: "average" or "conservative", see ``minigolf_env.physics.World``.

    Raises:
        ValueError: an argument, action or state is not what it should be; nothing has changed then.

    ## Version history
    v0: initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (the base class types it so)
        "render_modes": list(RENDER_MODES),
        "render_fps": RENDER_FPS,
    }

    def __init__(
        self,
        course: str | Course = "dogleg",
        render_mode: str | None = None,
        **options: Unpack[EnvOptions],
    ) -> None:
        self._sampler, self._observer, settings = build_env_config(course, RENDER_MODES, render_mode, **options)
        self.task = self._sampler.default()
        self.render_mode = render_mode
        self.renderer = EpisodeRenderer(self._render_context(), settings)
        self.action_space = action_space()
        self.observation_space = self._observer.space()
        self._position: FloatArray | None = None
        self._strokes = 0
        self._over = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Put the ball on the tee, or at ``options["position"]`` (3,), m; return (observation, info).

        ``options["level"]`` is the number of the level to play, of the training set or not; of a round it is
        ``options["hole"]``.
        """
        key = self._sampler.index_name
        given = check_options(options, key, "position")
        level, position = given.get(key), given.get("position")
        if position is not None and level is None and self._sampler.is_indexed:
            raise ValueError(f"position: expected with a '{key}', received none; it is a place on one {key}.")
        task = None if level is None else self._sampler.get(level)
        if position is not None:
            position = check_position(task or self.task, position)
        super().reset(seed=seed)
        last = None if seed is not None or self._position is None else self.task
        self.task = task or self._sampler.sample(self.np_random, last)
        if position is None:
            position = self.task.sample_start([self.np_random])[0]
        self._position, self._strokes, self._over = position, 0, False
        self.renderer.place_ball(position, self._render_context())
        return self._observe(), self._info("tee", 0.0, 0, holed=False)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Play one putt; return (observation, reward, terminated, truncated, info)."""
        before = self._ball()
        if self._over:
            raise ResetNeeded("The episode is over; call reset() before the next step().")
        putt = check_actions(action, (2,))
        draws = self.task.sample_noise([self.np_random]) if self.task.is_noisy else None
        velocity = self.task.launch_velocity(putt[None], draws)
        outcome = self.task.simulate(before[None], velocity)
        holed = bool(outcome.holed[0])
        self._position = outcome.position[0]
        self._strokes += 1
        self._over = holed or self._strokes >= self.task.max_strokes
        potential = self.task.potential
        reward = self.task.rewards(potential(before), potential(self._position), np.array(self._over))
        status = Result(int(outcome.result[0])).name.lower()
        info = self._info(status, float(outcome.time[0]), int(outcome.bounces[0]), holed=holed)
        self.renderer.add_putt(before, velocity[0], self._position)
        return self._observe(), float(reward), self._over, False, info

    def render(self) -> Any:
        """Return what the render mode promises: a picture, a list of pictures, or None."""
        self._ball()
        return self.renderer.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.renderer.close()

    def what_if(self, actions: ArrayLike) -> Outcome:
        """Return what putts (N, 2) from the present state would lead to, without noise and without moving the ball."""
        putts = check_actions(actions, (None, 2))
        return self.task.simulate(np.tile(self._ball(), (len(putts), 1)), self.task.launch_velocity(putts))

    def get_state(self) -> dict[str, Any]:
        """Return the episode's state, all that ``set_state`` needs to go on from here: plain values, a copy."""
        return encode_state(self._sampler, self.task, self._ball(), self._strokes, self._over, self.np_random)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from a state that ``get_state`` returned, or one with a "position" of your own (other keys optional).

        Raises:
            ValueError: the ball would not lie in free space within the bounds, or a value is not what it should be.
        """
        episode = decode_state(state, self._sampler, self.task)
        if not episode.over:
            check_positions(episode.task, episode.position)
        if episode.np_random is not None:
            self.np_random.bit_generator.state = episode.np_random
        self.task, self._position, self._strokes, self._over = episode[:4]
        self.renderer.place_ball(episode.position, self._render_context())

    def _ball(self) -> NDArray[np.float64]:
        if self._position is None:
            raise ResetNeeded("Call reset() first: there is no ball on the course yet.")
        return self._position

    def _observe(self) -> Observation:
        observed: Observation = self._observer.observe(self.task, self._ball()[None], np.array([self._strokes]))[0]
        return observed

    def _info(self, status: str, time: float, bounces: int, *, holed: bool) -> dict[str, Any]:
        return {
            "strokes": self._strokes,
            "is_success": holed,
            "status": status,
            "shot_time": time,
            "bounces": bounces,
            "course": self.task.course.name,
            **task_index_info(self._sampler, self.task),
        }

    def _render_context(self) -> RenderContext:
        return RenderContext(self.task.course, self.task.simulate_path)
