"""Mouse and keyboard bindings. A pyglet window calls the methods by their names."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pyglet
from pyglet.window import key, mouse

from minigolf_env.apps.play.app import App

TURN_STEP = 2.0
"""Turn of the aim for a key press, degrees."""

FINE_TURN_STEP = 0.2
"""Turn of the aim for a key press with Shift, degrees."""

POWER_STEP = 0.02
"""Change of power for a key press, as a share of the top speed."""

FINE_POWER_STEP = 0.005
"""Change of power for a key press with Shift, as a share of the top speed."""

ELEVATION_STEP = 5.0
"""Change of a throw's elevation for a key press, degrees."""

X11_DESTROY_NOTIFY = 17
"""X11's number of the event DestroyNotify."""

ORBIT_STEP = 40.0
"""Length of the mouse drag that turns the camera as far as a key press, pixels."""


class Controls:
    """Passes a window's mouse and keyboard events to the application.

    Args:
        app: the application.
    """

    def __init__(self, app: App) -> None:
        self._app = app
        self._press_position: tuple[int, int] | None = None
        self._keys_down = key.KeyStateHandler()
        app.window.window.push_handlers(self)
        app.window.window.push_handlers(self._keys_down)
        if sys.platform == "linux":
            # pyglet does not handle that another program destroys the window, and would crash at the next frame.
            app.window.window._event_handlers[X11_DESTROY_NOTIFY] = lambda event: self.on_close()
        self._actions: dict[int, Callable[[], object]] = {
            key.SPACE: self._confirm,
            key.ENTER: self._confirm,
            key.RETURN: self._confirm,
            key.NUM_ENTER: self._confirm,
            key.R: app.replay_last_stroke,
            key.Z: app.undo,
            key.N: app.next_hole,
            key.H: app.hint,
            key.V: app.toggle_recording,
            key.P: self._toggle_path,
            key.TAB: self._toggle_card,
            key.C: self._reset_camera,
            key.F12: app.screenshot,
            key.A: lambda: self._orbit(ORBIT_STEP),
            key.D: lambda: self._orbit(-ORBIT_STEP),
            key.W: lambda: self._raise(ELEVATION_STEP),
            key.S: lambda: self._raise(-ELEVATION_STEP),
            key.ESCAPE: self.on_close,
        }

    def on_mouse_press(self, x: int, y: int, button: int, modifiers: int) -> None:
        """Start to aim with the left button; cancel with the right one."""
        if button == mouse.LEFT:
            if self._app.is_ready:
                self._press_position = x, y
            else:
                self._app.skip()
        elif button == mouse.RIGHT and self._press_position is not None:
            self._press_position = None
            self._app.set_aim(None)

    def on_mouse_drag(self, x: int, y: int, dx: int, dy: int, buttons: int, modifiers: int) -> None:
        """Aim with the left button; turn the camera with the right one."""
        if buttons & mouse.LEFT and self._press_position is not None:
            self._app.drag_aim((x - self._press_position[0], y - self._press_position[1]))
        elif buttons & mouse.RIGHT:
            self._orbit(dx, dy)

    def on_mouse_release(self, x: int, y: int, button: int, modifiers: int) -> None:
        """Strike, unless the drag is too short."""
        if button == mouse.LEFT and self._press_position is not None:
            self._app.drag_aim((x - self._press_position[0], y - self._press_position[1]))
            self._press_position = None
            self._app.strike()

    def on_mouse_scroll(self, x: int, y: int, scroll_x: float, scroll_y: float) -> None:
        """Zoom; with Shift, change the elevation of a throw (some systems make that a horizontal scroll)."""
        if self._keys_down[key.LSHIFT] or self._keys_down[key.RSHIFT]:
            self._raise(ELEVATION_STEP / 2.0 * (scroll_y or scroll_x))
        else:
            self._app.view.zoom_in(scroll_y)
            self._app.wake()

    def on_key_press(self, symbol: int, modifiers: int) -> bool | None:
        """Run the key's action."""
        if symbol not in self._actions:
            return None
        self._actions[symbol]()
        return True

    def on_key_release(self, symbol: int, modifiers: int) -> None:
        """Toggle full screen; at the release, because the new window would never receive it after a press."""
        if symbol == key.F:
            window = self._app.window.window
            window.set_fullscreen(not window.fullscreen)
            self._app.wake()

    def on_text_motion(self, motion: int) -> None:
        """Change the aim by an arrow key, which repeats while it is held down."""
        self._nudge(motion, TURN_STEP, POWER_STEP)

    def on_text_motion_select(self, motion: int) -> None:
        """Change the aim in fine steps by an arrow key with Shift."""
        self._nudge(motion, FINE_TURN_STEP, FINE_POWER_STEP)

    def on_expose(self) -> bool:
        """Redraw a window that was hidden."""
        self._app.wake()
        return True

    def on_resize(self, width: int, height: int) -> None:
        """Redraw in the new size."""
        self._app.log("resize", size=[width, height])
        self._app.wake()

    def on_close(self) -> bool:
        """End the game."""
        pyglet.app.event_loop.exit()
        return True

    def _nudge(self, motion: int, turn: float, power: float) -> None:
        degrees = {key.MOTION_LEFT: turn, key.MOTION_RIGHT: -turn}.get(motion, 0.0)
        power_change = {key.MOTION_UP: power, key.MOTION_DOWN: -power}.get(motion, 0.0)
        if degrees or power_change:
            self._app.nudge_aim(degrees, power_change)

    def _confirm(self) -> None:
        """Strike; go to the next hole when the hole is over; skip a stroke that is displayed."""
        app = self._app
        if app.golf and app.golf.is_over and not app.is_busy:
            app.next_hole()
        elif app.is_ready:
            app.strike() if app.aim is not None else app.nudge_aim()
        else:
            app.skip()

    def _orbit(self, right: float, up: float = 0.0) -> None:
        self._app.view.orbit(right, up, self._app.window.window.get_size()[1])
        self._app.wake()

    def _raise(self, degrees: float) -> None:
        if self._app.golf is None:
            self._app.nudge_aim(elevation=degrees)

    def _toggle_path(self) -> None:
        self._app.path_shown = not self._app.path_shown
        self._app.show_message("Path shown" if self._app.path_shown else "Path hidden")

    def _toggle_card(self) -> None:
        if self._app.golf:
            self._app.card_shown = not self._app.card_shown
            self._app.wake()

    def _reset_camera(self) -> None:
        self._app.view.reset()
        self._app.wake()
