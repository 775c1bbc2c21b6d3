"""What is written over the picture: drawn with pyglet, in pixels of the framebuffer, after the renderer's picture.

Only what has changed is laid out again. Where there is no font, there are the power meter and the window's caption.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pyglet
from pyglet import gl, shapes

from minigolf_env.apps.play.guides import tint

FONTS = ["Inter", "Segoe UI", "Helvetica Neue", "Cantarell", "Noto Sans", "DejaVu Sans", "Arial"]
"""The first that is installed is used; without any of them, the system's default."""

DESIGN = 960.0, 600.0
"""Size of the window for which the lengths below are pixels; everything grows with the window."""

SMALLEST, LARGEST = 0.55, 4.0
"""Bounds of that growth."""

MARGIN, PAD = 14.0, 11.0
"""Around panels, and within them."""

DARK = (14, 20, 26, 168)
DARKER = (14, 20, 26, 222)
WHITE, GREY, GOLD, RED = (255, 255, 255, 255), (205, 214, 220, 255), (255, 214, 92, 255), (255, 82, 72, 255)

METER = 300.0, 12.0
"""Width and height of the power meter."""

NOTCHES = 40
"""Pieces of the meter, each of one colour."""

ROW, CARD_MARGIN = 28.0, 70.0
"""Height of a row of the score card, and what is left free above and below the card."""


class Facts(NamedTuple):
    """What the display says."""

    title: str = ""
    lines: tuple[str, ...] = ()
    """Under the title."""
    power: float | None = None
    """Share of the top speed; None: there is nothing to aim."""
    meter: str = ""
    """Beside the meter."""
    message: str = ""
    """In the middle, above."""
    help: tuple[str, ...] = ()
    card: tuple[tuple[str, ...], ...] = ()
    """Rows of the score card; none: it is not shown."""
    footer: str = ""
    """Under the score card."""
    recording: bool = False


class Sheet:
    """Panels and words that are laid out once and drawn many times."""

    def __init__(self, unit: float, written: bool) -> None:
        self.unit = unit
        self.batch = pyglet.graphics.Batch()
        self._written = written
        self._layers = [pyglet.graphics.Group(order=k) for k in range(3)]
        self._things: list[Any] = []

    def panel(self, x: float, y: float, width: float, height: float, color: tuple[int, int, int, int] = DARK) -> None:
        """Add a dark panel with round corners; x, y is its lower left corner, pixels."""
        radius, group = min(9.0 * self.unit, height / 2.0), self._layers[0]
        rectangle = shapes.RoundedRectangle(x, y, width, height, radius, color=color, batch=self.batch, group=group)
        self._things.append(rectangle)

    def box(self, x: float, y: float, width: float, height: float, color: tuple[int, int, int, int]) -> None:
        """Add a box on top of the panels."""
        group = self._layers[1]
        self._things.append(shapes.Rectangle(x, y, width, height, color=color, batch=self.batch, group=group))

    def dot(self, x: float, y: float, radius: float, color: tuple[int, int, int, int]) -> None:
        """Add a disc on top of the panels."""
        self._things.append(shapes.Circle(x, y, radius, color=color, batch=self.batch, group=self._layers[1]))

    def text(
        self,
        words: str,
        x: float,
        y: float,
        size: float,
        color: tuple[int, int, int, int] = WHITE,
        bold: bool = False,
        anchor: Any = "left",
    ) -> float:
        """Add words whose middle line is at y; return their width, pixels."""
        if not self._written or not words:
            return 0.0
        label = pyglet.text.Label(
            words,
            # On whole pixels, or letters blur.
            x=round(x),
            y=round(y),
            font_name=FONTS,
            # In points of 1/72 inch, at pyglet's 96 pixels an inch.
            font_size=0.75 * size * self.unit,
            weight="bold" if bold else "normal",
            color=color,
            anchor_x=anchor,
            anchor_y="center",
            batch=self.batch,
            group=self._layers[2],
        )
        self._things.append(label)
        return float(label.content_width)


class Hud:
    """Draws facts over the picture of a window.

    Args:
        window: a pyglet window.
    """

    def __init__(self, window: Any) -> None:
        self._window = window
        self._written = _has_font()
        self._sheets: dict[str, tuple[object, Sheet]] = {}

    def draw(self, facts: Facts) -> None:
        """Draw over what is in the window's framebuffer, whose OpenGL context is current."""
        width, height = size = self._window.get_framebuffer_size()
        self._window.projection = pyglet.math.Mat4.orthogonal_projection(0, width, 0, height, -1, 1)
        for switch in (gl.GL_DEPTH_TEST, gl.GL_CULL_FACE, gl.GL_SCISSOR_TEST):
            gl.glDisable(switch)
        gl.glBindVertexArray(0)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, 0)
        gl.glViewport(0, 0, width, height)
        if not self._written:
            self._window.set_caption(" · ".join((facts.title, *facts.lines, facts.meter, facts.message)))
        for name, key, lay_out in (
            ("status", (facts.title, facts.lines, facts.recording), _status),
            ("meter", (facts.power, facts.meter), _meter),
            ("help", facts.help, _help),
            ("message", (facts.message, bool(facts.card)), _message),
            ("card", (facts.card, facts.footer, facts.message), _card),
        ):
            self._sheet(name, (key, size), lay_out, facts).batch.draw()

    def _sheet(
        self, name: str, key: object, lay_out: Callable[[Sheet, Facts, float, float], None], facts: Facts
    ) -> Sheet:
        known = self._sheets.get(name)
        if known is not None and known[0] == key:
            return known[1]
        width, height = self._window.get_framebuffer_size()
        unit = min(LARGEST, max(SMALLEST, min(width / DESIGN[0], height / DESIGN[1])))
        sheet = Sheet(unit, self._written)
        lay_out(sheet, facts, width, height)
        self._sheets[name] = key, sheet
        return sheet


def _has_font() -> bool:
    try:
        return bool(pyglet.text.Label("0").content_width)
    except Exception:  # What a system without font libraries or fonts raises is many things.
        return False


def _status(sheet: Sheet, facts: Facts, width: float, height: float) -> None:
    """Lay out title and lines in the upper left corner, and the recording's light in the upper right one."""
    u = sheet.unit
    left, y = (MARGIN + PAD) * u, height - (MARGIN + PAD + 9.0) * u
    wide = sheet.text(facts.title, left, y, 18.0, bold=True)
    for line in facts.lines:
        y -= 20.0 * u
        wide = max(wide, sheet.text(line, left, y, 13.5, GREY))
    if wide:
        bottom = y - (PAD + 8.0) * u
        sheet.panel(MARGIN * u, bottom, wide + 2.0 * PAD * u, height - MARGIN * u - bottom)
    if facts.recording:
        right, middle = width - (MARGIN + PAD) * u, height - (MARGIN + 15.0) * u
        wide = sheet.text("REC", right, middle, 14.0, bold=True, anchor="right")
        sheet.dot(right - wide - 13.0 * u, middle, 6.0 * u, RED)
        panel = wide + (2.0 * PAD + 21.0) * u
        sheet.panel(width - MARGIN * u - panel, middle - 15.0 * u, panel, 30.0 * u)


def _meter(sheet: Sheet, facts: Facts, width: float, height: float) -> None:
    """Lay out the power meter at the bottom, above the help."""
    if facts.power is None:
        return
    u = sheet.unit
    wide, high = METER[0] * u, METER[1] * u
    left, bottom = (width - wide) / 2.0, 69.0 * u
    sheet.panel(left - PAD * u, bottom - PAD * u, wide + 2.0 * PAD * u, high + 37.0 * u)
    step = wide / NOTCHES
    for k in range(NOTCHES):
        red, green, blue = (int(255 * c) for c in tint((k + 0.5) / NOTCHES))
        sheet.box(left + k * step, bottom, step - 1.0 * u, high, (red, green, blue, 52))
        share = min(1.0, max(0.0, facts.power * NOTCHES - k))
        if share > 0.0:
            sheet.box(left + k * step, bottom, share * (step - 1.0 * u), high, (red, green, blue, 255))
    sheet.text("Power", left, bottom + high + 12.0 * u, 13.0, GREY)
    sheet.text(facts.meter, left + wide, bottom + high + 12.0 * u, 13.5, bold=True, anchor="right")


def _help(sheet: Sheet, facts: Facts, width: float, height: float) -> None:
    """Lay out the help at the bottom."""
    u = sheet.unit
    y = (MARGIN + 7.0 + 17.0 * (len(facts.help) - 1)) * u
    wide = 0.0
    for k, line in enumerate(facts.help):
        wide = max(wide, sheet.text(line, width / 2.0, y - 17.0 * k * u, 12.0, GREY, anchor="center"))
    if wide:
        sheet.panel((width - wide) / 2.0 - PAD * u, 5.0 * u, wide + 2.0 * PAD * u, (17.0 * len(facts.help) + 13.0) * u)


def _message(sheet: Sheet, facts: Facts, width: float, height: float) -> None:
    """Lay out the message in the middle, above; the score card has it as its heading."""
    if facts.card:
        return
    u = sheet.unit
    middle = height - 92.0 * u
    wide = sheet.text(facts.message, width / 2.0, middle, 22.0, bold=True, anchor="center")
    if wide:
        sheet.panel(width / 2.0 - wide / 2.0 - 18.0 * u, middle - 22.0 * u, wide + 36.0 * u, 44.0 * u)


def _card(sheet: Sheet, facts: Facts, width: float, height: float) -> None:
    """Lay out the score card in the middle; many holes make its rows lower."""
    if not facts.card:
        return
    u = sheet.unit
    row = min(ROW * u, (height - 2.0 * CARD_MARGIN * u) / (len(facts.card) + 2))
    size = row / (ROW * u)
    columns = [
        max(90.0 if k else 150.0, 30.0 + 9.5 * max(map(len, cells))) * u
        for k, cells in enumerate(zip(*facts.card, strict=True))
    ]
    wide, high = sum(columns) + 2.0 * PAD * u, row * (len(facts.card) + 2) + 2.0 * PAD * u
    left, top = (width - wide) / 2.0, (height + high) / 2.0
    sheet.panel(left, top - high, wide, high, DARKER)
    y = top - PAD * u - 0.6 * row
    sheet.text(facts.message or "Score card", width / 2.0, y, 17.0 * size, bold=True, anchor="center")
    for k, cells in enumerate(facts.card):
        y -= row
        head, total = k == 0, k == len(facts.card) - 1
        if head or total:
            line = y - 0.5 * row if head else y + 0.5 * row
            sheet.box(left + PAD * u, line, wide - 2.0 * PAD * u, max(1.0, u), (255, 255, 255, 90))
        x = left + PAD * u
        for column, (cell, span) in enumerate(zip(cells, columns, strict=True)):
            color = GREY if head else GOLD if column == len(columns) - 1 else WHITE
            at = x + 8.0 * u if column == 0 else x + span / 2.0
            sheet.text(cell, at, y, 14.0 * size, color, head or total, "left" if column == 0 else "center")
            x += span
    sheet.text(facts.footer, width / 2.0, y - row, 12.5 * size, GREY, anchor="center")
