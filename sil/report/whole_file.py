"""A file is there whole, or as it was before: written beside its place, then renamed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def beside(file: Path) -> Iterator[Path]:
    """Where to write what becomes `file` at the end; nothing is left if that fails. Raises OSError.

    What is no ordinary file, such as a pipe or /dev/stdout, is written to itself.
    """
    target = file.resolve()
    if target.exists() and not target.is_file():
        yield file
        return
    new = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        yield new
        new.replace(target)
    finally:
        new.unlink(missing_ok=True)
