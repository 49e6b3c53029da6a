"""A built site as a test sees it: its pages, and in each what it links to, loads and can be jumped to."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

LOADS = {  # element: attributes with which it loads something when the page is opened
    "audio": ("src",), "embed": ("src",), "iframe": ("src",), "img": ("src", "srcset"), "input": ("src",),
    "link": ("href",), "object": ("data",), "script": ("src",), "source": ("src", "srcset"), "track": ("src",),
    "image": ("href", "xlink:href"), "use": ("href", "xlink:href"), "video": ("src", "poster"),
}  # fmt: skip
NOT_LOADED = {"next", "prev", "index", "search", "author", "copyright", "canonical"}  # rel of what one clicks on


class Link(NamedTuple):
    """One target as it stands in the page."""

    page: Path
    target: str

    def file(self) -> Path:
        """What it leads to in the site."""
        path = unquote(re.split("[?#]", self.target)[0])
        return Path(os.path.normpath(self.page.parent / path)) if path else self.page

    @property
    def anchor(self) -> str:
        """Empty: the top."""
        return unquote(self.target.partition("#")[2])

    @property
    def is_address(self) -> bool:
        """Not a file of the site."""
        return bool(re.match(r"([a-z][a-z0-9+.-]*:|//)", self.target, re.IGNORECASE))


class SitePage(HTMLParser):
    """One HTML file. `clicked`: links to follow; `loaded`: what opens with it; `anchors`: ids; `words`: its text.

    `unsaid`: pictures without a text for those who do not see them.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.clicked: list[Link] = []
        self.loaded: list[Link] = []
        self.anchors: set[str] = set()
        self.unsaid: list[str] = []
        self.words = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.anchors |= {found[name] for name in ("id", "name") if name in found}
        if tag == "img" and not found.get("alt"):
            self.unsaid.append(found.get("src", ""))
        if tag == "a" and "href" in found:
            self.clicked.append(Link(self.path, found["href"]))
        if tag == "link" and set(found.get("rel", "").split()) & NOT_LOADED:
            return
        self.loaded += [Link(self.path, found[name]) for name in LOADS.get(tag, ()) if name in found]

    def handle_data(self, data: str) -> None:
        self.words += data


def pages_of(site: Path) -> dict[Path, SitePage]:
    """Every page by its file."""
    return {path: SitePage(path) for path in sorted(site.rglob("*.html"))}


def addresses_in_styles(site: Path) -> Iterator[tuple[str, str]]:
    """(file, what its url(...) or @import names) of what is neither in the site nor in the file itself."""
    for path in site.rglob("*.css"):
        for target in re.findall(r"(?:url\(|@import)\s*[\"']?([^\"')\s]+)", path.read_text(encoding="utf-8")):
            if not target.startswith(("data:", "#")) and not (path.parent / re.split("[?#]", target)[0]).is_file():
                yield path.name, target
