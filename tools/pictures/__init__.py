"""The pictures of the documents: `python -m tools.pictures`, or `make pictures`.

Each is made of runs that this makes itself in a temporary directory. `python -m tools.pictures NAME ...` makes those.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs" / "pictures"
NEEDS_BROWSER = ("report.png", "report-dark.png", "report-phone.png")
