"""Converts formulas to MathML, which browsers display without a script, a font or the internet."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

TEX_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
"""The HTML that pymdownx.arithmatex writes for $inline$ and $$display$$ formulas."""


def on_page_content(page_html: str, **_: Any) -> str:
    """Replace the TeX of a page's formulas by MathML."""
    return TEX_FORMULA.sub(_to_mathml, page_html)


def _to_mathml(formula: re.Match[str]) -> str:
    is_display = formula[1] == "div"
    mathml = convert(html.unescape(formula[2]), display="block" if is_display else "inline")
    return f'<div class="formula">{mathml}</div>' if is_display else mathml
