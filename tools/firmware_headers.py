"""The generated C in firmware/core/generated/: `python -m tools.firmware_headers --write` renews, `--check` compares.

Run --write after a change of layouts.py, messages.py, events.py, law_tables.py or of a law's STATE; a test checks.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import sys
from collections.abc import Callable
from pathlib import Path

GENERATED = Path(__file__).parent.parent / "firmware" / "core" / "generated"
FILES = {  # file: the function that makes its text
    "frames.h": "tools.c_frames:header",
    "law_states.h": "tools.c_states:law_states_h",
    "law_tables.h": "tools.c_law_tables:header",
    "law_tables.c": "tools.c_law_tables:source",
}


def main(argv: list[str] | None = None) -> int:
    """Exit code 1 when --check finds a file that is not what --write would write."""
    parser = argparse.ArgumentParser(prog="python -m tools.firmware_headers", description=__doc__)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", action="store_true", help="renew firmware/core/generated/")
    action.add_argument("--check", action="store_true", help="compare, and show what differs")
    options = parser.parse_args(argv)
    stale = 0
    for name, maker in FILES.items():
        path, text = GENERATED / name, _function(maker)()
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        if options.write:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        elif old != text:
            stale += 1
            sys.stdout.writelines(difflib.unified_diff(
                old.splitlines(True), text.splitlines(True), str(path), "what --write would write"
            ))  # fmt: skip
    return 1 if stale else 0


def _function(path: str) -> Callable[[], str]:
    module, _, name = path.partition(":")
    function: Callable[[], str] = getattr(importlib.import_module(module), name)
    return function


if __name__ == "__main__":
    sys.exit(main())
