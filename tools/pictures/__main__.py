"""Makes the pictures of the documents: `python -m tools.pictures [NAME ...]`, into docs/pictures/.

What is drawn of a terminal has times of this machine in it, and is another one each time; the rest is the same bytes
again on the same machine. What takes a Chromium is left as it is where there is none, and said.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tools.browser import program
from tools.pictures import FOLDER, NEEDS_BROWSER
from tools.pictures.studio import PICTURES, Studio


def main(names: list[str]) -> int:
    """Make those named, or all. Exit code 1: not all could be made, 2: no such picture."""
    if unknown := [name for name in names if name not in PICTURES]:
        print(f"no such picture: {', '.join(unknown)}; known: {', '.join(PICTURES)}", file=sys.stderr)
        return 2
    wanted = names or list(PICTURES)
    if without := [name for name in wanted if name in NEEDS_BROWSER and not program()]:
        print(f"no Chromium, so not made: {', '.join(without)}; apt-get install chromium", file=sys.stderr)
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(Path(folder))
        for name in wanted:
            if name in without:
                continue
            try:
                made = PICTURES[name](studio)
            except OSError as error:
                print(f"{name}: {error}", file=sys.stderr)
                return 1
            (FOLDER / name).write_bytes(made)
            print(f"{name}  {len(made) / 1000:,.0f} kB", flush=True)
    return 1 if without else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
