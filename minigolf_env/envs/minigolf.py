"""MiniGolf-v0: one putt a step."""

from __future__ import annotations

from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
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
from minigolf_env.envs.holes import FloatArray
from minigolf_env.envs.infos import single_info
from minigolf_env.envs.rewards import explain_unserializable
from minigolf_env.envs.stroke import play_stroke
from minigolf_env.envs.task import Outcome, action_space
from minigolf_env.rendering import RENDER_FPS, RENDER_MODES, EpisodeRenderer, PuttScene

Observation = NDArray[Any]
Action = NDArray[np.float32]


class MiniGolfEnv(gym.Env[Observation, Action]):
    """Minigolf with an exactly simulated ball on a course of closed triangle meshes. One step is one putt.

    ## Description
    The agent observes the ball's position, chooses a putt, and observes where the ball comes to rest. A step simulates
    the whole putt: until the ball rests, in the cup or elsewhere, or leaves the course, for at most 30 s. The goal is
    to hole out in as few strokes as possible.

    ## Action Space
    ``Box(-1, 1, (2,), float32)``: the putt as a vector in the xy-plane. Its direction is the direction of the putt; its
    length, clipped to 1, is the launch speed as a fraction of the top speed.

    ## Observation Space
    ``observation="state"``, the default, is ``Box(-1, 1, (10,), float32)``:

    | Number | Meaning | Scale |
    |---|---|---|
    | 0, 1, 2 | x, y and z of the ball | -1 and 1 at the course's bounds |
    | 3, 4, 5 | x, y and z from the ball to the centre of the cup's rim | 1 is the bounds' diagonal in the xy-plane |
    | 6, 7 | x and y of the horizontal unit vector to the cup, times number 8 | as 8 |
    | 8 | square root of the horizontal distance to the cup divided by the diagonal | 1 at a distance of the diagonal |
    | 9 | fraction of the strokes that is left | 1 at the tee, 0 after the last |

    ``observation="rays"`` is ``Box(-1, 1, (48,), float32)``: numbers 0 to 9; the free distance of the ball in 32
    horizontal directions, the first along x, counter-clockwise, 1 is 4 m or more; the depth of the ground below the
    ball, 1 is 0.5 m or more; the slope of the ground along x and y; numbers 6 and 7 in a scale that is the same on
    every hole, 1 is 8 m or more; and the height of the cup's rim above the ball's centre, m.

    ``observation="bounce_rays"`` is ``Box(-1, 1, (2320,), float32)``: numbers 0 to 9; the ground and cup numbers of
    "rays"; and for each of 96 rays, which follow the ground and are reflected off up to three walls, four segments of
    six numbers: x and y of the segment's end from the ball, 1 is 16 m; x and y of the wall's normal there; the height
    of the end and the greatest height so far, m.

    ``observation="pixels"`` is ``Box(0, 255, (84, 84, 3), uint8)``: an image of the course from above, x to the right
    and y up. The ball is a white marker, large enough to be visible; where something hides it, it shines through. The
    white part of the lowest two rows is the fraction of strokes left. The first image of a course takes 0.2 s.

    ## Rewards
    ``reward="strokes"`` is -1 a stroke, so that the return is minus the score. ``reward="shaped"``, the default, adds
    the change of a potential: minus (1 + 0.3 for each metre along the course to the cup), and zero when the episode has
    ended. Over an episode the changes add up to a constant, so that the best policy is the same, and the progress of a
    stroke is part of its immediate reward. ``reward`` may also be a function of your own, see
    ``minigolf_env.envs.rewards``.

    ## Starting State
    The ball is in the tee box: at a uniformly random place, or in its middle with ``tee="fixed"``.
    ``reset(options={"position": (x, y, z)})`` starts with the ball's centre there.

    With ``course="procedural"`` each reset draws a level from the set ``start_level`` ... ``start_level + num_levels -
    1``; ``reset(options={"level": 17})`` plays any level. The name of a level, which ``load_course`` takes too, is in
    info's "course".

    With ``course="round"`` the nine holes of ``minigolf_env.courses.ROUND_HOLES`` are played in turn, an episode each,
    and then the first again. A reset with a seed starts with the first hole; ``reset(options={"hole": 3})`` plays the
    third, and the next reset the fourth.

    ## Episode End
    ``terminated`` is true when the ball is in the cup, and after ``max_strokes``. That limit is a rule of the game, not
    a time limit: observations contain the strokes left. ``truncated`` is always false. The cup is a hole in the floor's
    mesh. The ball is holed when it rests in the cup, or is below the rim without the energy to come out. A ball out of
    bounds, or one that does not come to rest within 30 s, is put back where it was struck, and the stroke counts.

    ## Info
    ``strokes`` (int): strokes of the episode. ``is_success`` (bool): the ball is holed. ``status`` (str): result of the
    last stroke, "tee", "rest", "holed", "out_of_bounds" or "time_limit". ``shot_time`` (float): duration of the ball's
    motion in the last stroke, s. ``bounces`` (int): impacts of the last stroke. ``course`` (str): name of the hole.
    ``level`` (int): number of the level, on levels only. ``hole`` (int): number of the hole, from 1 on, in a round.
    ``minigolf_env.courses.par_of(info["course"])`` returns the par.

    ## Arguments

    Args:
        course: a name of ``minigolf_env.courses.list_courses()``; a course file; "round"; "procedural"; or a Course
            with a cup.
        difficulty: difficulty of the levels, "easy" (default), "medium" or "hard"; this argument and the next two are
            for "procedural" only.
        start_level: first level of the set; default 0.
        num_levels: number of levels in the set; default 500; 0: all 2**31 levels, whatever ``start_level`` is.
        render_mode: None; "rgb_array": ``render()`` returns an image (height, width, 3), uint8, of the ball at rest and
            the line of its last putt; "rgb_array_list": ``render()`` returns the images of all putts since the last
            call or the reset, 30 a second; "human": ``step()`` shows the putt in a window, in real time.
        render_size: width and height of the images or the window, pixels.
        camera: "follow" (from behind the ball), "top", "tee" (from behind the tee), "orbit" (turning around the
            course).
        render_profile: "high", with smooth edges; "fast"; or "auto", which is "high", but "fast" in a window drawn
            without a GPU.
        render_speed: speed of the putts in the window; 1 is real time.
        reward: "shaped", "strokes" or a function.
        observation: "state", "rays", "bounce_rays" or "pixels".
        max_strokes: number of strokes after which an episode ends, at least 1.
        tee: "random" or "fixed".
        top_speed: launch speed of a full putt, m/s; None: that of the course.
        cup_radius: radius of the cup, m; None: that of the course.
        putt_noise: standard deviations of a putt's direction (degrees) and speed (fraction of it). The noise is drawn
            from ``np_random``.
        dt: time step of the physics, s.
        impact: "average" or "conservative", see ``minigolf_env.physics.World``.

    Raises:
        ValueError: an argument, action or state has a wrong value; nothing has changed then.

    ## Version History
    v0: initial version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (the base class types it so)
        "render_modes": list(RENDER_MODES),
        "render_fps": RENDER_FPS,
    }
    _spec: EnvSpec | None = None

    def __init__(
        self,
        course: str | Course = "dogleg",
        render_mode: str | None = None,
        **options: Unpack[EnvOptions],
    ) -> None:
        config = build_env_config(course, RENDER_MODES, render_mode, **options)
        self._sampler = config.sampler
        self._observation = config.observation
        self._reward = config.reward
        self.task = self._sampler.default()
        self.render_mode = render_mode
        self.renderer = EpisodeRenderer(self._putt_scene(), config.render_settings)
        self.action_space = action_space()
        self.observation_space = self._observation.space()
        self._position: FloatArray | None = None
        self._strokes = 0
        self._over = False

    @property
    def spec(self) -> EnvSpec | None:
        """The spec that ``gym.make`` sets."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = explain_unserializable(spec)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode with the ball on the tee, or at ``options["position"]`` (3,), m.

        ``options["level"]`` is the number of a level to play, in the set or not; ``options["hole"]`` that of a hole of
        a round.

        Returns:
            The observation and the info.
        """
        # Validate everything before anything changes.
        index_name = self._sampler.index_name
        given = check_options(options, index_name, "position")
        index = given.get(index_name)
        position = given.get("position")
        if position is not None and index is None and self._sampler.is_indexed:
            raise ValueError(
                f"position: expected with a '{index_name}', received none; it is a place on one {index_name}."
            )
        task = None if index is None else self._sampler.get(index)
        if position is not None:
            position = check_position(task or self.task, position)
        super().reset(seed=seed)
        # Select the task and place the ball.
        previous = None if seed is not None or self._position is None else self.task
        self.task = task or self._sampler.sample(self.np_random, previous)
        if position is None:
            position = self.task.sample_start([self.np_random])[0]
        self._position = position
        self._strokes = 0
        self._over = False
        self.renderer.place_ball(position, self._putt_scene())
        return self._observe(self._observe_state()), self._info(None)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Play one putt; return (observation, reward, terminated, truncated, info)."""
        before = self._ball()
        if self._over:
            raise ResetNeeded("The episode is over; call reset() before the next step().")
        putt = check_actions(action, (2,))
        stroke = play_stroke(
            self.task, self._reward, before[None], putt[None], np.array([self._strokes]), [self.np_random]
        )
        self._position = stroke.outcome.position[0]
        self._strokes += 1
        self._over = bool(stroke.ended[0])
        self.renderer.add_putt(before, stroke.velocity[0], self._position)
        return self._observe(stroke.state), float(stroke.reward[0]), self._over, False, self._info(stroke.outcome)

    def render(self) -> Any:
        """Return an image, a list of images, or None, according to the render mode."""
        self._ball()
        return self.renderer.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self.renderer.close()

    def what_if(self, actions: ArrayLike) -> Outcome:
        """Return the outcome of putts (N, 2) from the present state, without noise and without moving the ball."""
        putts = check_actions(actions, (None, 2))
        return self.task.play(np.tile(self._ball(), (len(putts), 1)), putts).outcome

    def get_state(self) -> dict[str, Any]:
        """Return the episode's state: a copy in plain values, all that ``set_state`` needs to resume the episode."""
        return encode_state(self._sampler, self.task, self._ball(), self._strokes, self._over, self.np_random)

    def set_state(self, state: dict[str, Any]) -> None:
        """Resume an episode from a state of ``get_state``, or from a dict with a "position" and optional other keys.

        Raises:
            ValueError: the ball would not be in free space within the bounds, or a value is wrong; nothing has changed
                then.
        """
        episode = decode_state(state, self._sampler, self.task)
        if not episode.over:
            check_positions(episode.task, episode.position)
        if episode.np_random is not None:
            self.np_random.bit_generator.state = episode.np_random
        self.task = episode.task
        self._position = episode.position
        self._strokes = episode.strokes
        self._over = episode.over
        self.renderer.place_ball(episode.position, self._putt_scene())

    def _ball(self) -> FloatArray:
        """Return the ball's centre (3,), m, or raise before the first reset."""
        if self._position is None:
            raise ResetNeeded("Call reset() first: there is no ball on the course yet.")
        return self._position

    def _observe_state(self) -> NDArray[np.float32]:
        """Return the features "state" (1, 10)."""
        return self.task.observe_state(self._ball()[None], np.array([self._strokes]))

    def _observe(self, state: NDArray[np.float32]) -> Observation:
        """Return the observation of a ball with the features ``state`` (1, 10)."""
        observations = self._observation.observe(self.task, self._ball()[None], np.array([self._strokes]), state)
        observation: Observation = observations[0]
        return observation

    def _info(self, outcome: Outcome | None) -> dict[str, Any]:
        index = task_index_info(self._sampler, self.task)
        return single_info(self._strokes, outcome, self.task.course.name, index)

    def _putt_scene(self) -> PuttScene:
        return PuttScene(self.task.course, self.task.simulate_path)
