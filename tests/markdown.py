"""What is in a Markdown page: its code, its links, the anchors of its headings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(page for folder in ("benchmarks", "docs", "tests") for page in ROOT.glob(f"{folder}/**/*.md")),
    ]
)
"""All pages of the repository."""

COMPILED_ONLY = "<!-- compiled only: "
"""How a comment before a code block begins that is not to be run; it goes on with the reason."""


class Block(NamedTuple):
    """A code block."""

    language: str
    code: str
    line: int
    """Of the page, from 1: where it begins."""
    is_run: bool


def name(page: Path) -> str:
    """Return a page's path in the repository."""
    return page.relative_to(ROOT).as_posix()


@cache
def tokens(page: Path) -> list[Token]:
    """Return a page's blocks in the order of the text, tables included."""
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def blocks(page: Path, language: str) -> list[Block]:
    """Return a page's code blocks in a language."""
    found = []
    for before, token in zip([None, *tokens(page)], tokens(page), strict=False):
        if token.type == "fence" and token.info == language and token.map:
            is_run = before is None or not before.content.startswith(COMPILED_ONLY)
            found.append(Block(token.info, token.content, token.map[0] + 1, is_run))
    return found


def inline(page: Path, kind: str) -> Iterator[Token]:
    """Yield what is within a page's text, of a kind such as "link_open"."""
    for token in tokens(page):
        yield from (child for child in token.children or [] if child.type == kind)


def links(page: Path) -> list[str]:
    """Return where a page's links lead and its images are."""
    targets = [link.attrs["href"] for link in inline(page, "link_open")]
    return [str(target) for target in (*targets, *(image.attrs["src"] for image in inline(page, "image")))]


def anchors(page: Path) -> set[str]:
    """Return what links to a page's headings end in, as code hosts and the site agree on it."""
    opened = [k for k, token in enumerate(tokens(page)) if token.type == "heading_open"]
    texts = ["".join(part.content for part in tokens(page)[k + 1].children or []) for k in opened]
    return {re.sub(r"[^\w\s-]", "", text).strip().lower().replace(" ", "-") for text in texts}
