"""Lets pages link to files outside docs/ as they do on GitHub: `../experiments/results/fig12.png`.

Whatever a page links to comes into the site under its path in the repository, and the link is
written anew to lead there.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("experiments/README.md",)
"""Pages of the site that do not lie in docs/."""

LINK = re.compile(r"(?<=\]\()([^)\s#:]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages from outside docs/ and all that any page links to there."""
    for path in PAGES:
        files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
    for page in list(files.documentation_pages()):
        for link in LINK.findall(page.content_string):
            uri = _uri(page, link)
            if uri is not None and files.get_file_from_path(uri) is None:
                files.append(File.generated(config, uri, abs_src_path=str(ROOT / uri)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Writes the links that lead out of docs/, or back into it, anew."""

    def led(match: re.Match[str]) -> str:
        uri = _uri(page.file, match[0])
        folder = posixpath.dirname(page.file.src_uri)
        return match[0] if uri is None else posixpath.relpath(uri, folder or ".")

    return LINK.sub(led, markdown)


def _uri(page: File, link: str) -> str | None:
    """Where in the site a page's link leads if that file is there, else None."""
    folder = Path(page.abs_src_path or "").parent
    target = (folder / link).resolve()
    if not target.is_file() or not target.is_relative_to(ROOT):
        return None
    path = target.relative_to(ROOT).as_posix()
    return path.removeprefix("docs/")
