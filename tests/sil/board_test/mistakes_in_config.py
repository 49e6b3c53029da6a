"""Mistakes with CONFIG: how its parts are put together, and which READY answers it."""

from __future__ import annotations

from wrong_boards import Mistaken, wrong

from protocol import frames
from protocol.config import Assembly
from protocol.frames import Config, Ready
from protocol.law_tables import COMMON


class Answering(Mistaken):
    """A board that alters its READY."""

    def said(self, ready: Ready) -> Ready:
        return ready

    def _configure(self):
        return self.said(super()._configure())


@wrong("the index of a bad word is one too high", "config: bad words", "config: rows")
class OffByOne(Answering):
    def said(self, ready):
        return ready._replace(index=ready.index + 1) if ready.status == frames.READY_BAD_WORD else ready


@wrong("the index of a READY without one is 0", "config: statuses")
class IndexZero(Answering):
    def said(self, ready):
        return ready._replace(index=0) if ready.status == frames.READY_MISSING_PARTS else ready


@wrong("too few words are a bad word", "config: statuses", "config: parts")
class OtherStatus(Answering):
    def said(self, ready):
        return ready._replace(status=1) if ready.status == frames.READY_MISSING_PARTS else ready


@wrong("what the law refuses is taken", "config: statuses")
class TakesAll(Answering):
    def said(self, ready):
        return Ready(0, frames.NO_INDEX, 0x12345678) if ready.status == frames.READY_LAW_REFUSES else ready


@wrong("READY has another hash", "config: rows", "config: limits", "config: parts", "config: many words")
class OtherHash(Answering):
    def said(self, ready):
        return ready._replace(table_hash=ready.table_hash ^ 1) if ready.status == frames.READY_OK else ready


@wrong("a refusal has a hash", "config: statuses", "config: bad words")
class HashOfRefusal(Answering):
    def said(self, ready):
        return ready._replace(table_hash=7) if ready.status != frames.READY_OK else ready


class Ranged(Mistaken):
    """A board that looks at one common word in its own way."""

    word, verdict = "", (lambda value: None)

    def _configure(self):
        words = self._assembly.words() or ()
        index = [word.name for word in COMMON].index(self.word)
        if len(words) > index and (found := type(self).verdict(words[index])) is not None:
            return found
        return super()._configure()


@wrong("a word one above its range is taken", "config: bad words")
class TooWide(Ranged):
    word = "torque_bits"
    verdict = staticmethod(lambda value: Ready(0, frames.NO_INDEX, 1) if value == 31 else None)


@wrong("a word at the end of its range is refused", "config: limits")
class TooNarrow(Ranged):
    word = "torque_bits"
    verdict = staticmethod(lambda value: Ready(1, 10, 0) if value == 8 else None)


@wrong("the same tick twice in the guidance rows is taken", "config: rows")
class EqualTicks(Answering):
    def said(self, ready):
        words = self._assembly.words() or ()
        if ready.status == frames.READY_BAD_WORD and ready.index > 40 and words[ready.index] == words[ready.index - 4]:
            return Ready(0, frames.NO_INDEX, 1)
        return ready


@wrong("parts are put together as they come", "config: parts")
class AsTheyCome(Assembly):
    def words(self):
        return tuple(word for part in self._parts.values() for word in part.words)


@wrong("a repeated part counts as another one", "config: parts")
class CountsTwice(Assembly):
    def add(self, part: Config) -> bool:
        done = super().add(part)
        self.count = getattr(self, "count", 0) + 1
        return done or self.count >= part.parts


@wrong("parts that overlap are taken", "config: parts")
class Overlapping(Assembly):
    def words(self):
        words: list[int] = []
        for part in sorted(self._parts.values()):
            words[part.offset :] = part.words
        return tuple(words)


@wrong("parts outlive a new nonce", "config: parts")
class KeepsParts(Mistaken):
    def _forget(self):
        kept = getattr(self, "_assembly", None)
        super()._forget()
        self._assembly = kept or self._assembly


@wrong("a thousand rows end it", "config: many words")
class NoRoom(Mistaken):
    def _on_config(self, packet):
        if packet.frame.parts < 60:
            super()._on_config(packet)
