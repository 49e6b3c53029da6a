"""A machine as files: /proc, /sys and /dev of somewhere else, and devices that only claim to be some."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from sil.doctor.findings import Surroundings


def machine(root: Path, files: dict[str, str] | None = None, **options: object) -> Surroundings:
    """Surroundings below `root` with these files in them."""
    for path, text in (files or {}).items():
        place = root / path.lstrip("/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    return Surroundings(root=root, folder=root, search_path=(), **options)  # type: ignore[arg-type]


def character_device(mode: int = 0o660, gid: int = 0, rdev: int = os.makedev(188, 0)) -> os.stat_result:
    """What stat() says of /dev/ttyUSB0, whoever we are."""
    return os.stat_result((stat.S_IFCHR | mode, 0, 0, 1, 0, gid, 0, 0, 0, 0), {"st_rdev": rdev})
