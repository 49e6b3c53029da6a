"""python -m tools.reference --write renews docs/reference/; --check, the default, says what is out of date."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from tools.reference import FOLDER, PAGES


def main(argv: Sequence[str] | None = None) -> int:
    """0 in step, 1 not."""
    parser = argparse.ArgumentParser(prog="python -m tools.reference", description=__doc__)
    parser.add_argument("--write", action="store_true", help="renew the pages")
    parser.add_argument("--check", action="store_true", help="say what would change (the default)")
    options = parser.parse_args(argv)
    stale = [name for name, made in PAGES.items() if not _is(name, made(), options.write)]
    for name in stale:
        print(f"docs/reference/{name} is out of step: python -m tools.reference --write", file=sys.stderr)
    return 1 if stale else 0


def _is(name: str, text: str, write: bool) -> bool:
    """Whether the page is this text, at the latest now."""
    file = FOLDER / name
    if write:
        file.write_text(text, encoding="utf-8")
    return file.exists() and file.read_text(encoding="utf-8") == text


if __name__ == "__main__":
    sys.exit(main())
