"""Writes formulas as MathML, which browsers draw themselves: no script, no font, nothing from the internet."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
"""What pymdownx.arithmatex makes of $inline$ and $$displayed$$ formulas."""


def on_page_content(page_html: str, **_: Any) -> str:
    """Replace the TeX of a page's formulas by MathML."""
    return FORMULA.sub(_mathml, page_html)


def _mathml(formula: re.Match[str]) -> str:
    displayed = formula[1] == "div"
    mathml = convert(html.unescape(formula[2]), display="block" if displayed else "inline")
    return f'<div class="formula">{mathml}</div>' if displayed else mathml
