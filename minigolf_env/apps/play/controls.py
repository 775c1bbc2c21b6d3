"""Mouse and keys: what each does. A pyglet window calls the methods by their names."""

from __future__ import annotations

import sys
from collections.abc import Callable

import pyglet
from pyglet.window import key, mouse

from minigolf_env.apps.play.app import App

TURN, FINE_TURN = 2.0, 0.2
"""Degrees by which a key turns the aim, and with Shift."""

POWER, FINE_POWER = 0.02, 0.005
"""Share of the top speed by which a key changes the power, and with Shift."""

ELEVATION = 5.0
"""Degrees by which a key raises a throw."""

DESTROYED = 17
"""X11's number of the event DestroyNotify."""

ORBIT = 40.0
"""Pixels of a drag that a key turns the camera like."""


class Controls:
    """Listens to a window's mouse and keys and tells the app.

    Args:
        app: the game.
    """

    def __init__(self, app: App) -> None:
        self._app = app
        self._press: tuple[int, int] | None = None
        self._held = key.KeyStateHandler()
        app.window.window.push_handlers(self)
        app.window.window.push_handlers(self._held)
        if sys.platform == "linux":
            # pyglet overlooks that another program destroys the window, and would crash at the next picture.
            app.window.window._event_handlers[DESTROYED] = lambda event: self.on_close()
        self._keys: dict[int, Callable[[], object]] = {
            key.SPACE: self._go,
            key.ENTER: self._go,
            key.RETURN: self._go,
            key.NUM_ENTER: self._go,
            key.R: app.replay,
            key.Z: app.undo,
            key.N: app.next_hole,
            key.H: app.hint,
            key.V: app.record,
            key.P: self._toggle_path,
            key.TAB: self._toggle_card,
            key.C: self._reset_camera,
            key.F12: app.picture,
            key.A: lambda: self._look(ORBIT),
            key.D: lambda: self._look(-ORBIT),
            key.W: lambda: self._raise(ELEVATION),
            key.S: lambda: self._raise(-ELEVATION),
            key.ESCAPE: self.on_close,
        }

    def on_mouse_press(self, x: int, y: int, button: int, modifiers: int) -> None:
        """Begin to aim, or cancel."""
        if button == mouse.LEFT:
            if self._app.is_ready:
                self._press = x, y
            else:
                self._app.skip()
        elif button == mouse.RIGHT and self._press is not None:
            self._press = None
            self._app.take(None)

    def on_mouse_drag(self, x: int, y: int, dx: int, dy: int, buttons: int, modifiers: int) -> None:
        """Aim, or look around."""
        if buttons & mouse.LEFT and self._press is not None:
            self._app.pull((x - self._press[0], y - self._press[1]))
        elif buttons & mouse.RIGHT:
            self._look(dx, dy)

    def on_mouse_release(self, x: int, y: int, button: int, modifiers: int) -> None:
        """Strike, unless the drag was too short."""
        if button == mouse.LEFT and self._press is not None:
            self._app.pull((x - self._press[0], y - self._press[1]))
            self._press = None
            self._app.strike()

    def on_mouse_scroll(self, x: int, y: int, scroll_x: float, scroll_y: float) -> None:
        """Come closer; with Shift, raise a throw (some systems make that a scroll to the side)."""
        if self._held[key.LSHIFT] or self._held[key.RSHIFT]:
            self._raise(ELEVATION / 2.0 * (scroll_y or scroll_x))
        else:
            self._app.view.closer(scroll_y)
            self._app.wake()

    def on_key_press(self, symbol: int, modifiers: int) -> bool | None:
        """Do what the key says."""
        if symbol not in self._keys:
            return None
        self._keys[symbol]()
        return True

    def on_key_release(self, symbol: int, modifiers: int) -> None:
        """Fill the screen, or no more; not at the press, whose release the new window would never hear of."""
        if symbol == key.F:
            window = self._app.window.window
            window.set_fullscreen(not window.fullscreen)
            self._app.wake()

    def on_text_motion(self, motion: int) -> None:
        """Aim by an arrow key, which repeats while it is held."""
        self._nudge(motion, TURN, POWER)

    def on_text_motion_select(self, motion: int) -> None:
        """Aim by an arrow key with Shift."""
        self._nudge(motion, FINE_TURN, FINE_POWER)

    def on_expose(self) -> bool:
        """Draw again what was hidden."""
        self._app.wake()
        return True

    def on_resize(self, width: int, height: int) -> None:
        """Draw in the new size."""
        self._app.log("resize", size=[width, height])
        self._app.wake()

    def on_close(self) -> bool:
        """End the game."""
        pyglet.app.event_loop.exit()
        return True

    def _nudge(self, motion: int, turn: float, power: float) -> None:
        degrees = {key.MOTION_LEFT: turn, key.MOTION_RIGHT: -turn}.get(motion, 0.0)
        share = {key.MOTION_UP: power, key.MOTION_DOWN: -power}.get(motion, 0.0)
        if degrees or share:
            self._app.nudge(degrees, share)

    def _go(self) -> None:
        """Strike; or, when the hole is over, go to the next; or skip what is shown."""
        app = self._app
        if app.golf and app.golf.is_over and not app.is_busy:
            app.next_hole()
        elif app.is_ready:
            app.strike() if app.aim is not None else app.nudge()
        else:
            app.skip()

    def _look(self, right: float, up: float = 0.0) -> None:
        self._app.view.orbit(right, up, self._app.window.window.get_size()[1])
        self._app.wake()

    def _raise(self, degrees: float) -> None:
        if self._app.golf is None:
            self._app.nudge(elevation=degrees)

    def _toggle_path(self) -> None:
        self._app.path_shown = not self._app.path_shown
        self._app.say("Path shown" if self._app.path_shown else "Path hidden")

    def _toggle_card(self) -> None:
        if self._app.golf:
            self._app.card_shown = not self._app.card_shown
            self._app.wake()

    def _reset_camera(self) -> None:
        self._app.view.reset()
        self._app.wake()
