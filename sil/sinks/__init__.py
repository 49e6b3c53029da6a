"""Where records go: one line per sink, imported only when named."""

from __future__ import annotations

SINKS: dict[str, str] = {
    "journal": "sil.sinks.journal:Journal",
    "mcap": "sil.sinks.seal:seal",
    "nothing": "sil.sinks.nothing:Nothing",
}
