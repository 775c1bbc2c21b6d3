"""The head-up display: texts, power meter and score card, drawn with pyglet over the rendered frame.

Lengths are pixels of the framebuffer. A panel is laid out again only when its content changes. Without a font there are
the power meter and the window's caption.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pyglet
from pyglet import gl, shapes

from minigolf_env.apps.play.guides import power_color

RgbaColor = tuple[int, int, int, int]

FONT_NAMES = ["Inter", "Segoe UI", "Helvetica Neue", "Cantarell", "Noto Sans", "DejaVu Sans", "Arial"]
"""Fonts in order of preference; without any of them the system's default is used."""

REFERENCE_WINDOW_SIZE = 960.0, 600.0
"""Size of the window for which the lengths below are given; everything scales with the window."""

MIN_SCALE = 0.55
"""Smallest scale of texts and panels."""

MAX_SCALE = 4.0
"""Largest scale of texts and panels."""

PANEL_MARGIN = 14.0
"""Distance of panels from the window's edge."""

PANEL_PADDING = 11.0
"""Distance of a panel's edge from its content."""

POWER_METER_WIDTH = 300.0
"""Width of the power meter."""

POWER_METER_HEIGHT = 12.0
"""Height of the power meter."""

NUM_POWER_METER_SEGMENTS = 40
"""Number of segments of the power meter; each has one colour."""

SCORE_CARD_ROW_HEIGHT = 28.0
"""Height of a row of the score card, if all rows fit into the window."""

SCORE_CARD_MARGIN = 70.0
"""Smallest distance of the score card from the window's upper and lower edge."""

PANEL_COLOR = (14, 20, 26, 168)
"""Background of panels."""

SCORE_CARD_COLOR = (14, 20, 26, 222)
"""Background of the score card."""

RULE_COLOR = (255, 255, 255, 90)
"""Colour of the lines between the rows of the score card."""

WHITE_TEXT = (255, 255, 255, 255)
"""Colour of titles, messages and scores."""

GREY_TEXT = (205, 214, 220, 255)
"""Colour of help, labels and headers."""

GOLD_TEXT = (255, 214, 92, 255)
"""Colour of best scores."""

RECORDING_COLOR = (255, 82, 72, 255)
"""Colour of the recording light."""


class HudState(NamedTuple):
    """The content of the head-up display."""

    title: str = ""
    lines: tuple[str, ...] = ()
    """Lines under the title."""
    power: float | None = None
    """Power as a share of the top speed; None hides the meter."""
    meter: str = ""
    """Text above the power meter."""
    message: str = ""
    """Message at the top, or heading of the score card."""
    help: tuple[str, ...] = ()
    """Lines at the bottom."""
    card: tuple[tuple[str, ...], ...] = ()
    """Rows of the score card; no rows hide it."""
    footer: str = ""
    """Line under the score card."""
    recording: bool = False
    """True shows the recording light."""


class HudLayer:
    """Panels and texts that are laid out once and drawn many times.

    Args:
        scale: pixels for a unit of length.
        has_font: False leaves out all texts.
    """

    def __init__(self, scale: float, has_font: bool) -> None:
        self.scale = scale
        self.batch = pyglet.graphics.Batch()
        self._has_font = has_font
        self._groups = [pyglet.graphics.Group(order=k) for k in range(3)]
        self._items: list[Any] = []

    def panel(self, x: float, y: float, width: float, height: float, color: RgbaColor = PANEL_COLOR) -> None:
        """Add a dark panel with round corners; (x, y) is its lower left corner, pixels."""
        radius = min(9.0 * self.scale, height / 2.0)
        self._items.append(
            shapes.RoundedRectangle(x, y, width, height, radius, color=color, batch=self.batch, group=self._groups[0])
        )

    def box(self, x: float, y: float, width: float, height: float, color: RgbaColor) -> None:
        """Add a rectangle on top of the panels."""
        self._items.append(shapes.Rectangle(x, y, width, height, color=color, batch=self.batch, group=self._groups[1]))

    def disc(self, x: float, y: float, radius: float, color: RgbaColor) -> None:
        """Add a disc on top of the panels."""
        self._items.append(shapes.Circle(x, y, radius, color=color, batch=self.batch, group=self._groups[1]))

    def text(
        self,
        text: str,
        x: float,
        y: float,
        size: float,
        color: RgbaColor = WHITE_TEXT,
        bold: bool = False,
        anchor: Any = "left",
    ) -> float:
        """Add a text that is vertically centred on y; return its width, pixels."""
        if not self._has_font or not text:
            return 0.0
        label = pyglet.text.Label(
            text,
            # Whole pixels keep the letters sharp.
            x=round(x),
            y=round(y),
            font_name=FONT_NAMES,
            # Points of 1/72 inch, at pyglet's 96 pixels an inch.
            font_size=0.75 * size * self.scale,
            weight="bold" if bold else "normal",
            color=color,
            anchor_x=anchor,
            anchor_y="center",
            batch=self.batch,
            group=self._groups[2],
        )
        self._items.append(label)
        return float(label.content_width)


class Hud:
    """The head-up display of a window.

    Args:
        window: a pyglet window.
    """

    def __init__(self, window: Any) -> None:
        self._window = window
        self._has_font = _has_font()
        self._layers: dict[str, tuple[object, HudLayer]] = {}

    def draw(self, state: HudState) -> None:
        """Draw over the content of the window's framebuffer; its OpenGL context must be current."""
        width, height = size = self._window.get_framebuffer_size()
        self._window.projection = pyglet.math.Mat4.orthogonal_projection(0, width, 0, height, -1, 1)
        for capability in (gl.GL_DEPTH_TEST, gl.GL_CULL_FACE, gl.GL_SCISSOR_TEST):
            gl.glDisable(capability)
        gl.glBindVertexArray(0)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, 0)
        gl.glViewport(0, 0, width, height)
        if not self._has_font:
            self._window.set_caption(" · ".join((state.title, *state.lines, state.meter, state.message)))
        # Each layer is laid out again when the part of the state that it shows changes.
        for name, key, lay_out in (
            ("status", (state.title, state.lines, state.recording), _lay_out_status),
            ("meter", (state.power, state.meter), _lay_out_meter),
            ("help", state.help, _lay_out_help),
            ("message", (state.message, bool(state.card)), _lay_out_message),
            ("card", (state.card, state.footer, state.message), _lay_out_card),
        ):
            self._layer(name, (key, size), lay_out, state).batch.draw()

    def _layer(
        self, name: str, key: object, lay_out: Callable[[HudLayer, HudState, float, float], None], state: HudState
    ) -> HudLayer:
        """Return a layer, from the cache if its key is the same."""
        cached = self._layers.get(name)
        if cached is not None and cached[0] == key:
            return cached[1]
        width, height = self._window.get_framebuffer_size()
        scale = min(MAX_SCALE, max(MIN_SCALE, min(width / REFERENCE_WINDOW_SIZE[0], height / REFERENCE_WINDOW_SIZE[1])))
        layer = HudLayer(scale, self._has_font)
        lay_out(layer, state, width, height)
        self._layers[name] = key, layer
        return layer


def _has_font() -> bool:
    """Return whether pyglet can measure a text."""
    try:
        return bool(pyglet.text.Label("0").content_width)
    except Exception:  # Systems without font libraries or fonts raise many kinds of exception.
        return False


def _lay_out_status(layer: HudLayer, state: HudState, width: float, height: float) -> None:
    """Lay out title and lines in the upper left corner, and the recording light in the upper right one."""
    u = layer.scale
    left = (PANEL_MARGIN + PANEL_PADDING) * u
    y = height - (PANEL_MARGIN + PANEL_PADDING + 9.0) * u
    text_width = layer.text(state.title, left, y, 18.0, bold=True)
    for line in state.lines:
        y -= 20.0 * u
        text_width = max(text_width, layer.text(line, left, y, 13.5, GREY_TEXT))
    if text_width:
        bottom = y - (PANEL_PADDING + 8.0) * u
        panel_width = text_width + 2.0 * PANEL_PADDING * u
        layer.panel(PANEL_MARGIN * u, bottom, panel_width, height - PANEL_MARGIN * u - bottom)
    if state.recording:
        right = width - (PANEL_MARGIN + PANEL_PADDING) * u
        middle = height - (PANEL_MARGIN + 15.0) * u
        text_width = layer.text("REC", right, middle, 14.0, bold=True, anchor="right")
        layer.disc(right - text_width - 13.0 * u, middle, 6.0 * u, RECORDING_COLOR)
        panel_width = text_width + (2.0 * PANEL_PADDING + 21.0) * u
        layer.panel(width - PANEL_MARGIN * u - panel_width, middle - 15.0 * u, panel_width, 30.0 * u)


def _lay_out_meter(layer: HudLayer, state: HudState, width: float, height: float) -> None:
    """Lay out the power meter at the bottom, above the help."""
    if state.power is None:
        return
    u = layer.scale
    meter_width = POWER_METER_WIDTH * u
    meter_height = POWER_METER_HEIGHT * u
    left = (width - meter_width) / 2.0
    bottom = 69.0 * u
    padding = PANEL_PADDING * u
    layer.panel(left - padding, bottom - padding, meter_width + 2.0 * padding, meter_height + 37.0 * u)
    step = meter_width / NUM_POWER_METER_SEGMENTS
    for k in range(NUM_POWER_METER_SEGMENTS):
        red, green, blue = (int(255 * c) for c in power_color((k + 0.5) / NUM_POWER_METER_SEGMENTS))
        layer.box(left + k * step, bottom, step - 1.0 * u, meter_height, (red, green, blue, 52))
        filled = min(1.0, max(0.0, state.power * NUM_POWER_METER_SEGMENTS - k))
        if filled > 0.0:
            layer.box(left + k * step, bottom, filled * (step - 1.0 * u), meter_height, (red, green, blue, 255))
    text_y = bottom + meter_height + 12.0 * u
    layer.text("Power", left, text_y, 13.0, GREY_TEXT)
    layer.text(state.meter, left + meter_width, text_y, 13.5, bold=True, anchor="right")


def _lay_out_help(layer: HudLayer, state: HudState, width: float, height: float) -> None:
    """Lay out the help at the bottom."""
    u = layer.scale
    top = (PANEL_MARGIN + 7.0 + 17.0 * (len(state.help) - 1)) * u
    text_width = 0.0
    for k, line in enumerate(state.help):
        line_width = layer.text(line, width / 2.0, top - 17.0 * k * u, 12.0, GREY_TEXT, anchor="center")
        text_width = max(text_width, line_width)
    if text_width:
        padding = PANEL_PADDING * u
        panel_height = (17.0 * len(state.help) + 13.0) * u
        layer.panel((width - text_width) / 2.0 - padding, 5.0 * u, text_width + 2.0 * padding, panel_height)


def _lay_out_message(layer: HudLayer, state: HudState, width: float, height: float) -> None:
    """Lay out the message at the top; the score card shows it as its heading instead."""
    if state.card:
        return
    u = layer.scale
    middle = height - 92.0 * u
    text_width = layer.text(state.message, width / 2.0, middle, 22.0, bold=True, anchor="center")
    if text_width:
        left = width / 2.0 - text_width / 2.0 - 18.0 * u
        layer.panel(left, middle - 22.0 * u, text_width + 36.0 * u, 44.0 * u)


def _lay_out_card(layer: HudLayer, state: HudState, width: float, height: float) -> None:
    """Lay out the score card in the middle; many holes make its rows lower."""
    if not state.card:
        return
    u = layer.scale
    padding = PANEL_PADDING * u
    # Measure the rows and columns.
    row_height = min(SCORE_CARD_ROW_HEIGHT * u, (height - 2.0 * SCORE_CARD_MARGIN * u) / (len(state.card) + 2))
    text_scale = row_height / (SCORE_CARD_ROW_HEIGHT * u)
    column_widths = [
        max(90.0 if k else 150.0, 30.0 + 9.5 * max(map(len, cells))) * u
        for k, cells in enumerate(zip(*state.card, strict=True))
    ]
    card_width = sum(column_widths) + 2.0 * padding
    card_height = row_height * (len(state.card) + 2) + 2.0 * padding
    left = (width - card_width) / 2.0
    top = (height + card_height) / 2.0
    # Lay out the heading, the rows and the footer from top to bottom.
    layer.panel(left, top - card_height, card_width, card_height, SCORE_CARD_COLOR)
    y = top - padding - 0.6 * row_height
    layer.text(state.message or "Score card", width / 2.0, y, 17.0 * text_scale, bold=True, anchor="center")
    for k, cells in enumerate(state.card):
        y -= row_height
        is_header = k == 0
        is_total = k == len(state.card) - 1
        if is_header or is_total:
            rule_y = y - 0.5 * row_height if is_header else y + 0.5 * row_height
            layer.box(left + padding, rule_y, card_width - 2.0 * padding, max(1.0, u), RULE_COLOR)
        x = left + padding
        for column, (cell, column_width) in enumerate(zip(cells, column_widths, strict=True)):
            color = GREY_TEXT if is_header else GOLD_TEXT if column == len(column_widths) - 1 else WHITE_TEXT
            text_x = x + 8.0 * u if column == 0 else x + column_width / 2.0
            anchor = "left" if column == 0 else "center"
            layer.text(cell, text_x, y, 14.0 * text_scale, color, is_header or is_total, anchor)
            x += column_width
    layer.text(state.footer, width / 2.0, y - row_height, 12.5 * text_scale, GREY_TEXT, anchor="center")
