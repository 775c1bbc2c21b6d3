"""Code blocks, links, tables and heading anchors of the Markdown pages."""

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
"""Start of the comment before a code block that is not to be run; the reason follows."""


class Block(NamedTuple):
    """A code block."""

    language: str
    code: str
    line: int
    """Line of the page on which the block begins, from 1."""
    is_run: bool
    """False for a block after a COMPILED_ONLY comment."""


def name(page: Path) -> str:
    """Return a page's path relative to the repository."""
    return page.relative_to(ROOT).as_posix()


@cache
def tokens(page: Path) -> list[Token]:
    """Return the block tokens of a page, tables included."""
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def blocks(page: Path, language: str) -> list[Block]:
    """Return a page's code blocks in a language."""
    result = []
    for previous, token in zip([None, *tokens(page)], tokens(page), strict=False):
        if token.type == "fence" and token.info == language and token.map:
            is_run = previous is None or not previous.content.startswith(COMPILED_ONLY)
            result.append(Block(token.info, token.content, token.map[0] + 1, is_run))
    return result


def inline(page: Path, token_type: str) -> Iterator[Token]:
    """Yield a page's inline tokens of a type such as "link_open"."""
    for token in tokens(page):
        yield from (child for child in token.children or [] if child.type == token_type)


def links(page: Path) -> list[str]:
    """Return the targets of a page's links and images."""
    targets = [link.attrs["href"] for link in inline(page, "link_open")]
    sources = [image.attrs["src"] for image in inline(page, "image")]
    return [str(target) for target in targets + sources]


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as code hosts and the site derive them from the text."""
    headings = [k + 1 for k, token in enumerate(tokens(page)) if token.type == "heading_open"]
    texts = ["".join(child.content for child in tokens(page)[k].children or []) for k in headings]
    return {re.sub(r"[^\w\s-]", "", text).strip().lower().replace(" ", "-") for text in texts}
