"""Lets pages link to files outside of docs/ as they do on a code host: such a file gets a page of its own in the site.

The site is docs/ laid over the root of the repository: docs/courses.md becomes courses.html, agents/x.py becomes
agents/x.py.html, a page that shows the source. Links are followed from page to page.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
DOCS = "docs/"

LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s#]+)(#[^)\s]*)?(?=\))")
"""A relative link's target, and the anchor in it."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files of the repository that pages link to."""
    todo = list(files.documentation_pages())
    while todo:
        page = todo.pop()
        for target, _ in LINK.findall(page.content_string):
            path = _in_repository(page.src_uri, target)
            if not path.startswith(DOCS) and (ROOT / path).is_file() and _in_site(path) not in files.src_uris:
                file = _page(path, config)
                files.append(file)
                todo.append(file)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links from the repository's tree to the site's."""
    here = page.file.src_uri

    def turned(link: re.Match[str]) -> str:
        path = _in_repository(here, link[1])
        return posixpath.relpath(_in_site(path), posixpath.dirname(here)) + (link[2] or "")

    return markdown if _is_source(here) else LINK.sub(turned, markdown)


def _page(path: str, config: MkDocsConfig) -> File:
    """Return the page of a file of the repository, as it is or as the source that it is."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if not path.endswith(".md"):
        # Who searches wants what pages say; and more backticks than any docstring has in a row.
        head = "---\nsearch:\n  exclude: true\nhide: [toc]\n---\n"
        text = f"{head}# {path}\n\n`````{Path(path).suffix[1:]}\n{text}\n`````\n"
    return File.generated(config, _in_site(path), content=text, inclusion=InclusionLevel.NOT_IN_NAV)


def _in_repository(src_uri: str, target: str) -> str:
    """Return the path in the repository of what a page of the site links to."""
    if (ROOT / DOCS / src_uri).is_file():
        src_uri = DOCS + src_uri
    return posixpath.normpath(posixpath.join(posixpath.dirname(src_uri), target))


def _in_site(path: str) -> str:
    """Return where a file of the repository is in the site."""
    if path.startswith(DOCS):
        return path.removeprefix(DOCS)
    return path if path.endswith(".md") else f"{path}.md"


def _is_source(src_uri: str) -> bool:
    return not (ROOT / DOCS / src_uri).is_file() and not (ROOT / src_uri).is_file()
