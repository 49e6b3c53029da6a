"""Scripts of others that ship in the report's page: what they are, and how to renew them: `python -m tools.vendored`.

Without arguments it says whether the files are those of the note; `--write VERSION` gets that version with npm, puts
its files and its licence in place, and renews the note. Nothing of this happens at install or run time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "sil" / "report" / "page" / "assets" / "vendor"
NOTE = FOLDER / "vendored.json"
PACKAGE, LICENCE = "uplot", "MIT"
FILES = {
    "uPlot.iife.min.js": "package/dist/uPlot.iife.min.js",
    "uPlot.min.css": "package/dist/uPlot.min.css",
    "uPlot.LICENSE": "package/LICENSE",
}


def note(version: str) -> str:
    """The note of the files as they are."""
    hashes = {name: hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() for name in FILES}
    content = {"package": PACKAGE, "version": version, "licence": LICENCE, "sha256": hashes}
    return json.dumps(content, indent=2) + "\n"


def is_as_noted() -> bool:
    """The files have the hashes of the note."""
    return note(json.loads(NOTE.read_text())["version"]) == NOTE.read_text()


def renew(version: str) -> None:
    """Get this version and put it in place."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["npm", "pack", "--silent", f"{PACKAGE}@{version}"], cwd=folder, check=True)
        (archive,) = Path(folder).glob("*.tgz")
        with tarfile.open(archive) as tar:
            for name, inside in FILES.items():
                member = tar.extractfile(inside)
                assert member is not None
                (FOLDER / name).write_bytes(member.read().rstrip() + b"\n")
    NOTE.write_text(note(version))


def main() -> int:
    parser = argparse.ArgumentParser(description="Vendored scripts of the report's page.")
    parser.add_argument("--write", metavar="VERSION", help="get this version, such as 1.6.32")
    version = parser.parse_args().write
    if version:
        renew(version)
    elif not is_as_noted():
        print(f"{FOLDER}: its files are not those of {NOTE.name}", file=sys.stderr)
        return 1
    print(NOTE.read_text(), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
