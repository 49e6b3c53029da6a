"""Pages of docs/reference/ that are made from the product: `python -m tools.reference --write` renews them.

A test holds them against what the product says now.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tools.reference import cli_page, python_page, scenario_page, topics_page

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "reference"
PAGES: dict[str, Callable[[], str]] = {
    "cli.md": cli_page.markdown,
    "python.md": python_page.markdown,
    "scenario.md": scenario_page.markdown,
    "topics.md": topics_page.markdown,
}
