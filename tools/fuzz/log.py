"""Target `log`: a run directory one of whose files is not what was written: what reads it raises its own errors only.

Input: which file (u8, one of FILES), then its content. The rest of the directory is that of a short run. CRCs are right
again after most mutations, so that what is behind them is reached.
"""

from __future__ import annotations

import io
import json
import shutil
import struct
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from sil.replay import replay
from sil.report import info
from sil.report.export import rows
from sil.runner import run_scenario
from sil.runs import RunError, open_run
from sil.scenario import load_scenario
from sil.scenario_errors import ScenarioInvalid
from sil.sinks.journal import JournalError
from sil.sinks.seal import SealError, recover
from sil.trouble import SilError
from tools.fuzz import expect, expect_lines
from tools.fuzz.mutation import mutated
from tools.fuzz.scenario import ODD

FILES = ("run.mcap", "run.journal", "timing.mcap", "summary.json")
REFUSED = (SilError, RunError, SealError, JournalError)
SHORT = ("duration_s=12", "require=[{metric: missed, below: 1}]", "board=inproc", "link.url=inproc")
HEAD, JOURNAL_HEADER = struct.Struct("<IIB"), 12
JSON_KINDS = (1, 2, 8, 9)
PROBLEMS = 40  # of a recorded scenario that is refused, a line each


class Log:
    """See above."""

    about = "Python: damaged logs into open_run, recover, info, export, replay"

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-log-")
        self._whole = Path(self._folder.name) / "whole"
        self._damaged = Path(self._folder.name) / "damaged"
        run_scenario(load_scenario("appc-rs232", SHORT), self._whole)
        shutil.copytree(self._whole, self._damaged)
        self._pristine = [(self._whole / name).read_bytes() for name in FILES]

    def seeds(self) -> list[bytes]:
        """Each file as it was, and the MCAP files without compression and CRCs, so that any byte of them may differ."""
        made = [bytes([number]) + content for number, content in enumerate(self._pristine)]
        return made + [bytes([number]) + _plain_mcap(self._pristine[number]) for number in (0, 2)]

    def mutate(self, data: bytes, random: Random) -> bytes:
        """A record, a value in JSON, or bytes."""
        number, content = (data[0] if data else 0) % len(FILES), data[1:]
        structured: Callable[[bytes, Random], bytes]
        structured = (_other_mcap, _other_journal, _other_mcap, _other_json)[number]
        if random.random() < 0.75:
            try:
                return bytes([number]) + structured(content, random)
            except Exception:  # the mutations before this one left nothing that could be read
                content = self._pristine[number]
        return bytes([number]) + mutated(content, random, self._pristine)

    def check(self, data: bytes) -> None:
        number = (data[0] if data else 0) % len(FILES)
        for at, name in enumerate(FILES):
            (self._damaged / name).write_bytes(data[1:] if at == number else self._pristine[at])
        try:
            if number == 1:
                expect(recover(self._damaged).ticks >= 0, "recover: a negative number of ticks")
            read_all(self._damaged)
        except REFUSED as error:
            expect_lines(error, PROBLEMS if isinstance(error, ScenarioInvalid) else 1)


def read_all(folder: Path) -> None:
    """All that the command line reads of a run."""
    run = open_run(folder)
    for name in run.names:
        expect(len(run[name]) == len(run), f"{name}: {len(run[name])} rows of {len(run)}")
    _ = run.events, run.samples, repr(run), list(rows(run))
    content = info.info(run)
    json.dumps(content, allow_nan=False)
    info.text(content)
    replay(run)


# -- MCAP -------------------------------------------------------------------------------------------------------------


def _records(content: bytes) -> list[Any]:
    wanted = (Schema, Channel, Message, Metadata, Attachment)
    found = StreamReader(io.BytesIO(content), record_size_limit=1 << 26).records
    records = [record for record in found if isinstance(record, wanted)]
    last = max((at for at, record in enumerate(records) if isinstance(record, Message)), default=0)
    head = records[: last + 1]  # the summary repeats schemas and channels
    return head + [record for record in records[last + 1 :] if isinstance(record, Metadata | Attachment)]


def _written(records: list[Any], crcs: bool, compression: CompressionType) -> bytes:
    file = io.BytesIO()
    writer = Writer(file, compression=compression, enable_crcs=crcs, enable_data_crcs=crcs)
    writer.start(profile="", library="attitude-sil")
    schemas, channels = {0: 0}, {}
    for record in records:
        if isinstance(record, Schema):
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel):
            named = record.topic, record.message_encoding, schemas.get(record.schema_id, 0), record.metadata
            channels[record.id] = writer.register_channel(*named)
        elif isinstance(record, Message):
            channel = channels.get(record.channel_id, record.channel_id)
            writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        else:
            writer.add_attachment(0, 0, record.name, record.media_type, record.data)
    writer.finish()
    return file.getvalue()


def _plain_mcap(content: bytes) -> bytes:
    return _written(_records(content), False, CompressionType.NONE)


def _other_mcap(content: bytes, random: Random) -> bytes:
    records = _records(content)
    for _ in range(1 + random.randrange(3)):
        at = random.randrange(len(records))
        apart = [n for n, record in enumerate(records) if not isinstance(record, Message)]
        at = random.choice(apart) if random.random() < 0.5 and apart else at
        kind = random.randrange(8)
        if kind == 0:
            del records[at]
        elif kind == 1:
            records.insert(random.randrange(len(records)), records[at])
        else:
            _change(records[at], random)
    return _written(records, True, CompressionType.NONE)


def _change(record: Any, random: Random) -> None:
    if isinstance(record, Message):
        if random.random() < 0.3:
            record.log_time = random.choice((0, 1, 500_000_000, record.log_time + 1, 2**63, 2**64 - 1))
        else:
            record.data = mutated(record.data, random)
    elif isinstance(record, Metadata | Channel):
        key = random.choice([*record.metadata, "law"])
        record.metadata = {**record.metadata, key: _other_text(record.metadata.get(key, ""), random)}
        if random.random() < 0.2:
            record.metadata.pop(key)
    elif isinstance(record, Attachment):
        record.data = _other_json(record.data, random)
    else:
        record.data = mutated(record.data, random)


# -- journal ----------------------------------------------------------------------------------------------------------


def _other_journal(content: bytes, random: Random) -> bytes:
    records = []
    at = JOURNAL_HEADER
    while at + HEAD.size <= len(content):
        length, tick, kind = HEAD.unpack_from(content, at)
        records.append((kind, tick, content[at + HEAD.size : at + HEAD.size + length]))
        at += HEAD.size + length + 4
    for _ in range(1 + random.randrange(3)):
        at = random.randrange(len(records))
        if random.random() < 0.3:
            at = random.choice([n for n, each in enumerate(records) if each[0] in JSON_KINDS] or [at])
        what = random.randrange(8)
        if what == 0:
            del records[at : at + 1 + int(random.random() ** 3 * 40)]
        elif what == 1:
            records.insert(random.randrange(len(records)), records[at])
        else:
            records[at] = _other_record(*records[at], random)
    made = [content[:JOURNAL_HEADER]]
    for kind, tick, payload in records:
        body = HEAD.pack(len(payload), tick, kind) + payload
        made += [body, struct.pack("<I", zlib.crc32(body))]
    whole = b"".join(made)
    return whole[: random.randrange(len(whole))] if random.random() < 0.1 else whole


def _other_record(kind: int, tick: int, payload: bytes, random: Random) -> tuple[int, int, bytes]:
    what = random.random()
    if what < 0.15:
        return random.choice((*range(12), 255)), tick, payload
    if what < 0.35:
        return kind, random.choice((0, 1, tick + 1, tick + 600, 2**31, 2**32 - 2, 2**32 - 1)), payload
    if kind in JSON_KINDS and what < 0.9:
        return kind, tick, _other_json(payload, random)
    return kind, tick, mutated(payload, random)


# -- JSON -------------------------------------------------------------------------------------------------------------


def _other_text(text: str, random: Random) -> str:
    if random.random() < 0.5:
        return _other_json(text.encode(), random).decode(errors="replace")
    return mutated(text.encode(), random).decode(errors="replace")


def _other_json(content: bytes, random: Random) -> bytes:
    """Another value somewhere; or other bytes, where it is no JSON."""
    if random.random() < 0.1:
        return mutated(content, random)
    try:
        value = json.loads(content)
    except (ValueError, RecursionError):
        return mutated(content, random)
    return json.dumps(_elsewhere(value, random)).encode()


def _elsewhere(value: Any, random: Random) -> Any:
    if isinstance(value, dict) and value and random.random() < 0.92:
        key = random.choice(list(value))
        if random.random() < 0.1:
            return {name: item for name, item in value.items() if name != key}
        return {**value, key: _elsewhere(value[key], random)}
    if isinstance(value, list) and value and random.random() < 0.7:
        at = random.randrange(len(value))
        return [*value[:at], _elsewhere(value[at], random), *value[at + 1 :]]
    odd = random.choice(ODD)
    return str(odd) if isinstance(odd, float | int) and abs(odd) > 2**80 else odd
