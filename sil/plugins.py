"""Plug-in folders: one line `"name": "package.module:Class"` per thing, imported only when it is named."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any


class UnknownPlugin(ValueError):
    """A name that no line of the registry carries."""

    def __init__(self, what: str, name: str, known: Mapping[str, str]) -> None:
        super().__init__(f"{what}: expected one of {', '.join(sorted(known))}, got {name!r}")


def load(registry: Mapping[str, str], what: str, name: str) -> Any:
    """The class registered under `name`; `what` (such as "plant.kind") starts the message of UnknownPlugin."""
    if name not in registry:
        raise UnknownPlugin(what, name, registry)
    module, _, attribute = registry[name].partition(":")
    return getattr(importlib.import_module(module), attribute)
