"""Adds a page for each file outside docs/ that a page links to, so that the same links work on a code host.

The site is docs/ laid over the root of the repository. docs/courses.md becomes courses.html. agents/x.py becomes
agents/x.py.html, a page with its source. notebooks/x.ipynb becomes notebooks/x.ipynb.html, the rendered notebook.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from notebook_markdown import notebook_to_markdown

REPOSITORY_ROOT = Path(__file__).parents[2]
DOCS_FOLDER = "docs/"

RELATIVE_LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s#]+)(#[^)\s]*)?(?=\))")
"""The target of a relative link, and its anchor."""

SOURCE_FRONT_MATTER = "---\nsearch:\n  exclude: true\nhide: [toc]\n---\n"
"""Settings of a page with source code: search finds only text pages."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the repository's files that pages link to, directly or through other added pages."""
    queue = list(files.documentation_pages())
    while queue:
        page = queue.pop()
        for target, _ in RELATIVE_LINK.findall(page.content_string):
            path = _repository_path(page.src_uri, target)
            is_outside_docs = not path.startswith(DOCS_FOLDER) and (REPOSITORY_ROOT / path).is_file()
            if is_outside_docs and _site_path(path) not in files.src_uris:
                file = _create_page(path, config)
                files.append(file)
                queue.append(file)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrite the relative links of a page from the repository's tree to the site's."""
    src_uri = page.file.src_uri

    def rewrite(link: re.Match[str]) -> str:
        path = _repository_path(src_uri, link[1])
        return posixpath.relpath(_site_path(path), posixpath.dirname(src_uri)) + (link[2] or "")

    return markdown if _is_source_page(src_uri) else RELATIVE_LINK.sub(rewrite, markdown)


def _create_page(path: str, config: MkDocsConfig) -> File:
    """Return the page of a repository file: Markdown as it is, a notebook rendered, other files as source code."""
    file = REPOSITORY_ROOT / path
    if path.endswith(".ipynb"):
        text = notebook_to_markdown(file)
    elif path.endswith(".md"):
        text = file.read_text(encoding="utf-8")
    else:
        # Five backticks: more than any docstring has in a row.
        source = file.read_text(encoding="utf-8")
        text = f"{SOURCE_FRONT_MATTER}# {path}\n\n`````{file.suffix[1:]}\n{source}\n`````\n"
    return File.generated(config, _site_path(path), content=text, inclusion=InclusionLevel.NOT_IN_NAV)


def _repository_path(src_uri: str, target: str) -> str:
    """Return the path in the repository of a link's target on a page of the site."""
    if (REPOSITORY_ROOT / DOCS_FOLDER / src_uri).is_file():
        src_uri = DOCS_FOLDER + src_uri
    return posixpath.normpath(posixpath.join(posixpath.dirname(src_uri), target))


def _site_path(path: str) -> str:
    """Return the path in the site of a file of the repository."""
    if path.startswith(DOCS_FOLDER):
        return path.removeprefix(DOCS_FOLDER)
    return path if path.endswith(".md") else f"{path}.md"


def _is_source_page(src_uri: str) -> bool:
    """Return whether a page shows the source code of a file."""
    is_markdown = (REPOSITORY_ROOT / DOCS_FOLDER / src_uri).is_file() or (REPOSITORY_ROOT / src_uri).is_file()
    return not is_markdown and not src_uri.endswith(".ipynb.md")
