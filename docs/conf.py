"""The site: how Sphinx and MyST make build/docs of docs/; `make docs` runs it, without any network.

Links are the files' own, so that they lead to the same place here and where a git host shows the files. Two pages are
files that stand elsewhere in the repository (PAGES_FROM); links to those files lead to these pages.
"""

from __future__ import annotations

import os
import re
from importlib.metadata import version as version_of
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.transforms import SphinxTransform

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
REPO = DOCS.parent
PAGES_FROM = {"reference/wire": "protocol/SPEC.md", "changelog": "CHANGELOG.md"}
LINKS_TO = {source: f"{page}.md" for page, source in PAGES_FROM.items()} | {"README.md": "index.md"}
ORDER: dict[str, tuple[str, ...]] = {  # of the pages of a folder in the sidebar; others come behind these, by name
    "concepts": (
        "laboratory-cable-board", "timing-contract", "fixed-point", "determinism", "ladder", "faults-of-the-link",
        "verdicts-and-metrics",
    ),
    "how-to": (
        "run-a-scenario", "report", "live-view", "read-logs", "notebooks", "compare-runs", "write-a-scenario",
        "own-law", "own-plant", "own-board", "law-in-c", "two-machines", "real-time", "faults-on-purpose",
        "late-sensors", "many-runs", "margin-map", "design-a-controller", "ci", "doctor", "bench", "recover",
        "troubleshoot",
    ),
    "papers": ("five-papers",),
    "reference": ("cli", "scenario", "scenarios", "python", "topics", "wire", "glossary"),
}  # fmt: skip
PLAIN = ("crc", "frame", "law", "layout", "packet", "stream")  # names that SPEC.md gives its blocks
FOLDER = re.compile(r"^([\w-]+)/\*$", re.MULTILINE)
LINK = re.compile(r"(?<=\]\()([^)\s#]+)(#[^)\s]+)?(?=\))")

project = "attitude-sil"
author = "The attitude-sil engineers"
release = version_of("attitude-sil")
extensions = ["myst_parser", "sphinx_copybutton"]
exclude_patterns = ["examples", "pictures", "_*"]
nitpicky = True
smartquotes = False  # --clock is no dash

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
myst_links_external_new_tab = False
copybutton_prompt_text = r"\$ "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = "attitude-sil"
html_logo = html_favicon = "_static/logo.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = html_show_copyright = False
html_use_index = html_show_search_summary = False  # a page opened from a disk may not fetch others
pygments_style, pygments_dark_style = "tango", "github-dark"
html_theme_options = {
    "top_of_page_buttons": [],
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#56B4E9"},
}


def in_order(app: Sphinx, page: str, text: list[str]) -> None:
    """`concepts/*` in the index becomes the pages of that folder, as ORDER has them."""
    if page == "index":
        text[0] = FOLDER.sub(lambda found: "\n".join(_pages_of(found[1])), text[0])


def _pages_of(folder: str) -> list[str]:
    known = ORDER.get(folder, ())
    names = sorted(file.stem for file in (DOCS / folder).glob("*.md"))
    names.sort(key=lambda name: known.index(name) if name in known else len(known))
    return [f"{folder}/{name}" for name in names]


def of_elsewhere(app: Sphinx, page: str, text: list[str]) -> None:
    """The text of a page that stands elsewhere, and links that lead to its page."""
    here = DOCS / f"{page}.md"
    if page in PAGES_FROM:
        here = REPO / PAGES_FROM[page]
        app.env.note_dependency(str(here), docname=page)
        text[0] = here.read_text(encoding="utf-8")
    text[0] = LINK.sub(lambda found: _relinked(found[1], found[2] or "", here, page), text[0])


def _relinked(target: str, anchor: str, here: Path, page: str) -> str:
    """A link of the file `here`, as it has to be on `page`; addresses, and what is no file, are left as they are."""
    if "://" in target or not (file := Path(os.path.normpath(here.parent / target))).exists():
        return target + anchor
    known = LINKS_TO.get(file.relative_to(REPO).as_posix()) if file.is_relative_to(REPO) else None
    found = DOCS / known if known else file
    kept = "" if file.name == "README.md" else anchor  # the front page has other headings
    return PurePosixPath(os.path.relpath(found, (DOCS / page).parent)).as_posix() + kept


class InTheDark(SphinxTransform):
    """A picture that has a sibling NAME-dark is shown on light paper, its sibling on dark paper."""

    default_priority = 400

    def apply(self) -> None:
        for light in list(self.document.findall(nodes.image)):
            uri = PurePosixPath(light["uri"])
            sibling = uri.with_stem(f"{uri.stem}-dark")
            if (DOCS / self.env.docname).parent.joinpath(sibling).is_file():
                dark = light.deepcopy()
                dark["uri"] = str(sibling)
                for node, paper in ((light, "light"), (dark, "dark")):
                    node["classes"] = [*node["classes"], f"only-{paper}"]
                light.parent.insert(light.parent.index(light) + 1, dark)


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this once."""
    for name in PLAIN:
        app.add_lexer(name, TextLexer)
    app.add_transform(InTheDark)
    app.connect("source-read", of_elsewhere)
    app.connect("source-read", in_order)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
