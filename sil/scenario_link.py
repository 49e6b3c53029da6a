"""Section `link` of a scenario: the cable, and what is wrong with it on purpose.

What the faults mean, byte by byte: protocol/SPEC.md, section 7.1; the model: protocol/faulty.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BeforeValidator, Field, WithJsonSchema

from protocol.faulty import Burst, Faults, Jitter
from sil.scenario_errors import Path
from sil.scenario_sections import Expected, NotNegative, Positive, Section, Url, is_number

LONGEST_PERIODS = 100  # of delay and jitter; answers are remembered for longer than that
DATAGRAMS = ("udp", "inproc")  # links whose frames may overtake each other; inproc stands for either kind
Refusal = tuple[Path, str, Any]  # key, expected, got


def _probability(value: object) -> object:
    if value is None:
        return None
    if not is_number(value) or not 0 <= float(value) <= 1:  # type: ignore[arg-type]
        raise Expected("a probability from 0 to 1")
    return float(value)  # type: ignore[arg-type]


def _spans(value: object) -> object:
    if value is None:
        return None
    spans = value if isinstance(value, tuple) else ()
    pairs = [each for each in spans if isinstance(each, tuple) and len(each) == 2 and all(map(is_number, each))]
    if not isinstance(value, tuple) or len(pairs) != len(spans):
        raise Expected("a list of [from_s, to_s]")
    return tuple((float(start), float(end)) for start, end in pairs)


CHANCE = {"type": "number", "minimum": 0, "maximum": 1}
SPAN = {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 2, "maxItems": 2}
Probability = Annotated[float, BeforeValidator(_probability), WithJsonSchema(CHANCE)]
MaybeProbability = Annotated[
    float | None, BeforeValidator(_probability), WithJsonSchema({**CHANCE, "type": ["number", "null"]})
]
Spans = Annotated[
    tuple[tuple[float, float], ...] | None,
    BeforeValidator(_spans),
    WithJsonSchema({"anyOf": [{"type": "array", "items": SPAN}, {"type": "null"}]}),
]


class BurstFault(Section):
    """Loss in bursts (Gilbert-Elliott): a good and a bad state, which may change once per tick.

    Either the probabilities of changing (p_bad and p_good), or how much of the time is bad and how long it stays so
    (share and mean_ticks).
    """

    p_bad: MaybeProbability = None
    """From good to bad, per tick."""
    p_good: MaybeProbability = None
    """From bad to good, per tick."""
    share: MaybeProbability = None
    """Share of the ticks that are bad, below 1."""
    mean_ticks: Annotated[float, Field(ge=1)] | None = None
    """Mean length of a bad stretch."""
    loss_bad: Probability = 1.0
    """Probability that a frame is lost in the bad state."""
    loss_good: Probability = 0.0
    """And in the good state."""

    def model(self) -> Burst:
        """For the channel."""
        if self.share is not None and self.mean_ticks is not None:
            p_good = 1.0 / self.mean_ticks
            return Burst(p_good * self.share / (1.0 - self.share), p_good, self.loss_bad, self.loss_good)
        return Burst(self.p_bad or 0.0, self.p_good or 0.0, self.loss_bad, self.loss_good)


class JitterFault(Section):
    """Delay on top of delay_s that differs from frame to frame, never below 0, never above max_s."""

    distribution: Literal["uniform", "normal", "exponential"] = "uniform"
    """Cut off at 0 and max_s; uniform over the whole span."""
    max_s: NotNegative
    """The most there can be."""
    mean_s: Positive | None = None
    """For normal and exponential: the mean, before they are cut off."""
    sigma_s: Positive | None = None
    """For normal: the standard deviation, before it is cut off."""

    def model(self) -> Jitter:
        """For the channel."""
        return Jitter(self.distribution, _ns(self.max_s), _ns(self.mean_s or 0.0), _ns(self.sigma_s or 0.0))


class OneWay(Section):
    """Faults of one direction; null: as link.faults has it. Probabilities are per frame unless said otherwise."""

    drop: MaybeProbability = None
    """The frame is lost."""
    burst: BurstFault | None = None
    """The frame is lost, in bursts."""
    bit_error_rate: MaybeProbability = None
    """Per bit of 0x00, COBS(packet), 0x00: it is turned over."""
    byte_loss: MaybeProbability = None
    """Per byte of the same: it is missing."""
    duplicate: MaybeProbability = None
    """The frame comes twice; each copy has a fate of its own."""
    reorder: MaybeProbability = None
    """Datagrams only: the frame is overtaken by that of the next tick."""
    delay_s: NotNegative | None = None
    """On top of the wire time."""
    jitter: JitterFault | None = None
    """On top of both, another one for every frame."""
    disconnect: Spans = None
    """Spans of time, [[from_s, to_s], ...]: every frame that is on the wire at any time of one is lost."""
    baud: Annotated[int, Field(gt=0)] | None = None
    """Bit rate of this direction; null: link.baud."""


class LinkFaults(OneWay):
    """What is wrong on purpose, both ways; up and down override it key by key. The handshake is exempt."""

    up: OneWay = OneWay()
    """To the board."""
    down: OneWay = OneWay()
    """To the laboratory."""

    @property
    def any(self) -> bool:
        """Something is said."""
        return self != LinkFaults()

    def of(self, way: OneWay, key: str) -> Any:
        """The value of `key` in one direction; None: no such fault."""
        own = getattr(way, key)
        return getattr(self, key) if own is None else own


class Link(Section):
    """The cable; `link: URL` is short for its url."""

    url: Url = "pty"
    """pty, udp, inproc, udp://HOST:PORT, /dev/X or serial:///dev/X?baud=N"""
    baud: Annotated[int, Field(gt=0)] | None = None
    """Bit rate whose wire time is modelled (10 bits a byte); null: the wire takes no time."""
    faults: LinkFaults = LinkFaults()
    """What is wrong with it on purpose."""

    def models(self) -> tuple[Faults, Faults]:
        """What the channel does, up and down."""
        up, down = (self._model(way) for way in (self.faults.up, self.faults.down))
        return up, down

    def _model(self, way: OneWay) -> Faults:
        def value(key: str) -> Any:
            return self.faults.of(way, key)

        burst, jitter, spans = value("burst"), value("jitter"), value("disconnect") or ()
        return Faults(
            drop=value("drop") or 0.0,
            burst=None if burst is None else burst.model(),
            bit_error_rate=value("bit_error_rate") or 0.0,
            byte_loss=value("byte_loss") or 0.0,
            duplicate=value("duplicate") or 0.0,
            reorder=value("reorder") or 0.0,
            delay_ns=_ns(value("delay_s") or 0.0),
            jitter=None if jitter is None else jitter.model(),
            disconnect_ns=tuple((_ns(start), _ns(end)) for start, end in spans),
            baud=value("baud") or self.baud,
        )


def _ns(time_s: float) -> int:
    return round(time_s * 1e9)


# -- what one key alone cannot tell ------------------------------------------------------------------------------------


class _Around(NamedTuple):
    """The rest of the scenario, as far as faults have to fit it."""

    board: str
    url: str
    period_s: float
    duration_s: float


def faults_problems(faults: LinkFaults, board: str, url: str, period_s: float, duration_s: float) -> Iterator[Refusal]:
    """Faults that contradict each other or the rest of the scenario: (key below link.faults, expected, got)."""
    if not faults.any:
        return
    if board == "none":
        yield (), "no link faults with board none, which has no link", "some"
    around = _Around(board, url, period_s, duration_s)
    for name, way in (("", faults), ("up", faults.up), ("down", faults.down)):
        path: Path = (name,) if name else ()
        for key, found in _of_one(faults, way, around):
            yield (*path, *key), *found


def _of_one(faults: LinkFaults, way: OneWay, around: _Around) -> Iterator[tuple[Path, tuple[str, Any]]]:
    """What is said in one direction, or for both."""
    if way.burst is not None:
        yield from ((("burst", *key), found) for key, found in _burst(way.burst))
    if way.jitter is not None:
        yield from ((("jitter", *key), found) for key, found in _jitter(way.jitter))
    yield from _disconnects(way, around)
    is_stream = around.url.partition(":")[0] not in DATAGRAMS
    if way.reorder and is_stream:
        yield (
            ("reorder",),
            ("0 on a byte stream, where no frame overtakes another (link udp has datagrams)", way.reorder),
        )
    delay_s, jitter = faults.of(way, "delay_s") or 0.0, faults.of(way, "jitter")
    jitter_s = jitter.max_s if jitter is not None else 0.0
    if delay_s + jitter_s > LONGEST_PERIODS * around.period_s and (way.delay_s or way.jitter):
        key: Path = ("delay_s",) if way.delay_s else ("jitter", "max_s")
        most = LONGEST_PERIODS * around.period_s
        yield key, (f"a number in s, at most {LONGEST_PERIODS} periods ({most:g}) with jitter", delay_s + jitter_s)
    elif way.jitter is not None and is_stream and way.jitter.max_s >= around.period_s:
        expected = f"a number in s below the period ({around.period_s:g}) on a byte stream: beyond it frames overtake"
        yield ("jitter", "max_s"), (expected, way.jitter.max_s)


def _burst(burst: BurstFault) -> Iterator[tuple[Path, tuple[str, Any]]]:
    rates = (burst.p_bad, burst.p_good)
    lengths = (burst.share, burst.mean_ticks)
    said = [key for key in ("p_bad", "p_good", "share", "mean_ticks") if getattr(burst, key) is not None]
    if (None in rates or lengths != (None, None)) and (None in lengths or rates != (None, None)):
        yield (), ("p_bad and p_good, or share and mean_ticks", " and ".join(said) or "neither")
    elif burst.share is not None and burst.mean_ticks is not None:
        most = burst.mean_ticks / (1 + burst.mean_ticks)
        if burst.share > most:
            yield ("share",), (f"at most {most:.4g} with bad stretches of {burst.mean_ticks:g} ticks", burst.share)
    if burst.loss_good > burst.loss_bad:
        yield ("loss_good",), (f"at most loss_bad ({burst.loss_bad:g})", burst.loss_good)


def _jitter(jitter: JitterFault) -> Iterator[tuple[Path, tuple[str, Any]]]:
    needed = {"uniform": (), "normal": ("mean_s", "sigma_s"), "exponential": ("mean_s",)}[jitter.distribution]
    for key in ("mean_s", "sigma_s"):
        value = getattr(jitter, key)
        if (value is None) == (key in needed):
            expected = (
                f"a number in s for {jitter.distribution}" if key in needed else f"none for {jitter.distribution}"
            )
            yield (key,), (expected, value)


def _disconnects(way: OneWay, around: _Around) -> Iterator[tuple[Path, tuple[str, Any]]]:
    before_s = 0.0
    for index, (start_s, end_s) in enumerate(way.disconnect or ()):
        got = (start_s, end_s)
        if start_s >= end_s:
            yield ("disconnect", index), ("[from_s, to_s], the earlier first", got)
        elif end_s > around.duration_s:
            yield ("disconnect", index), (f"an end within the run ({around.duration_s:g} s)", got)
        elif start_s < before_s:
            yield ("disconnect", index), (f"a start not before {before_s:g} s, in order of time", got)
        before_s = max(before_s, end_s)
