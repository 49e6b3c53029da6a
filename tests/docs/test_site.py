"""The site builds without a warning and without a network, and is whole: pages, anchors, pictures, search.

In a Chromium it also draws without a complaint, desktop and phone, light and dark; in CI that must be there.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from site_pages import SitePage, addresses_in_styles, pages_of

from tools.browser import Browser

REPO = Path(__file__).resolve().parents[2]
DOCS = REPO / "docs"
SOURCES = sorted(str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md"))
REFERENCE = ("cli", "scenario", "python", "topics", "wire")
KINDS = ("index", "quick-start", "how-to/real-time", *(f"reference/{name}" for name in REFERENCE))


def sphinx(source: Path, target: Path) -> subprocess.CompletedProcess[str]:
    """What `make docs` runs."""
    options = ["--fail-on-warning", "--keep-going", "--quiet", "--doctree-dir", str(target.with_name("doctrees"))]
    command = [sys.executable, "-P", "-m", "sphinx", *options, str(source), str(target)]
    return subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built once by whichever worker comes first; AssertionError with Sphinx's warnings, if any."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "site"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        told = folder / "told"
        if not told.exists():
            done = sphinx(DOCS, folder / "html")
            told.write_text(f"{done.stdout}{done.returncode}")
    assert told.read_text() == "0"
    return folder / "html"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, SitePage]:
    return pages_of(site)


def test_every_page_of_docs_is_reached_from_the_index(site: Path, pages: dict[Path, SitePage]) -> None:
    reached, new = set(), {site / "index.html"}
    while new:
        reached |= new
        links = [link for page in new for link in pages[page].clicked if not link.is_address]
        new = {link.file() for link in links if link.file() in pages} - reached
    assert {name for name in SOURCES if site / f"{name}.html" not in reached} == set()


def test_links_and_anchors_lead_somewhere(pages: dict[Path, SitePage]) -> None:
    links = [link for page in pages.values() for link in (*page.clicked, *page.loaded) if not link.is_address]
    assert len(links) > 1000
    assert [link for link in links if not link.file().is_file()] == []
    jumps = [link for link in links if link.anchor and link.file() in pages]
    assert [link for link in jumps if link.anchor not in pages[link.file()].anchors] == []


def test_nothing_is_loaded_from_anywhere_else(site: Path, pages: dict[Path, SitePage]) -> None:
    """In the browser, below, what scripts ask for is refused, too."""
    loaded = [link for page in pages.values() for link in page.loaded]
    assert [link for link in loaded if link.is_address and not link.target.startswith("data:")] == []
    assert list(addresses_in_styles(site)) == []


def test_every_picture_has_a_text_in_its_place(pages: dict[Path, SitePage]) -> None:
    assert {page.path.name: page.unsaid for page in pages.values() if page.unsaid} == {}


def test_the_pages_that_stand_elsewhere_are_those_files(site: Path, pages: dict[Path, SitePage]) -> None:
    for name, source in (("reference/wire", "protocol/SPEC.md"), ("changelog", "CHANGELOG.md")):
        headings = re.findall(r"^#+ ([^`\n]+)$", (REPO / source).read_text(), re.MULTILINE)
        assert headings and [each for each in headings if each not in pages[site / f"{name}.html"].words] == []
    links = {link.target for page in pages.values() for link in page.clicked}
    assert not any(target.endswith(("SPEC.md", "README.md", "CHANGELOG.md")) for target in links)


def test_a_broken_link_a_broken_anchor_and_a_missing_picture_break_the_build(tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    shutil.copytree(DOCS / "_static", docs / "_static")
    shutil.copy(DOCS / "conf.py", docs)
    text = "# A page\n\n[no page](nowhere.md), [no heading](#no-heading), ![no picture](nowhere.png)\n"
    (docs / "index.md").write_text(text)
    done = sphinx(docs, tmp_path / "html")
    assert done.returncode != 0
    wrong = ("target not found: 'nowhere.md'", "target not found: 'no-heading'", "not readable: nowhere.png")
    assert [warning for warning in wrong if warning not in done.stdout] == []


# -- in a browser --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KINDS)
def test_a_page_fits_desktop_and_phone_and_asks_nobody(browser: Browser, site: Path, name: str) -> None:
    for width, dark in ((1400, False), (390, True)):
        browser.open(site / f"{name}.html", width, 844, dark, folder=site)
        browser.frames()
        assert (browser.requests, browser.console) == ([], [])
        assert browser.ask("document.documentElement.scrollWidth") <= width
        shade = browser.ask("getComputedStyle(document.body).backgroundColor.match(/[0-9]+/g).map(Number)[0]")
        assert shade < 64 if dark else shade > 192


def test_dark_paper_shows_dark_pictures(browser: Browser, site: Path) -> None:
    shown = "[...document.querySelectorAll('article img')].filter((each) => each.offsetWidth).map((each) => each.src)"
    for dark, name, other in ((False, "/report.png", "/report-dark.png"), (True, "/report-dark.png", "/report.png")):
        browser.open(site / "index.html", dark=dark, folder=site)
        pictures = browser.ask(shown)
        assert any(each.endswith(name) for each in pictures)
        assert not any(each.endswith(other) for each in pictures)


def test_the_search_finds_a_key_and_an_option(browser: Browser, site: Path) -> None:
    for words, page in (("max_lateness_ms", "reference/scenario"), ("retry failed", "reference/cli")):
        browser.open(site / "search.html", folder=site, query=f"?q={words.replace(' ', '+')}")
        browser.until(f"!!document.querySelector('#search-results a[href*=\"{page}.html\"]')")
        assert (browser.requests, browser.console) == ([], [])
