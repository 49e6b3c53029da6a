"""The CONFIG words in transit: cut into parts that fit a packet, and put together again in any order."""

from __future__ import annotations

from collections.abc import Sequence

from protocol.frames import MAX_CONFIG_WORDS, Config

MAX_PARTS = 320  # 4096 guidance rows and the words before them
MAX_WORDS = MAX_PARTS * MAX_CONFIG_WORDS


class TooManyWords(ValueError):
    """More CONFIG words than a board has to keep."""

    def __init__(self, count: int) -> None:
        super().__init__(f"config: {count} words, at most {MAX_WORDS} (fewer guidance rows)")


def split(words: Sequence[int]) -> tuple[Config, ...]:
    """The parts that carry `words` (int32), each as full as a packet allows."""
    if len(words) > MAX_WORDS:
        raise TooManyWords(len(words))
    starts = range(0, max(len(words), 1), MAX_CONFIG_WORDS)
    return tuple(
        Config(part, len(starts), start, tuple(words[start : start + MAX_CONFIG_WORDS]))
        for part, start in enumerate(starts)
    )


class Assembly:
    """The board's side: parts in, words out once every part has come. A repeated part replaces itself."""

    def __init__(self) -> None:
        self._parts: dict[int, Config] = {}

    def add(self, part: Config) -> bool:
        """Keep one part; True when all have come. A part of another cut (`parts` differs) begins a new assembly."""
        if any(known.parts != part.parts for known in self._parts.values()):
            self._parts.clear()
        if part.parts <= MAX_PARTS:
            self._parts[part.part] = part
        return len(self._parts) == part.parts

    def words(self) -> tuple[int, ...] | None:
        """The words when the parts join without gap or overlap, else None."""
        words: tuple[int, ...] = ()
        for _, part in sorted(self._parts.items()):
            if part.offset != len(words):
                return None
            words += part.words
        return words
