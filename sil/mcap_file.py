"""Reads an MCAP file from end to end with the mcap library, every CRC checked before anything is taken from it.

The library checks chunks and the data section (messages, metadata, attachments) when told to; the summary, from which
nothing is taken here, is checked too, so that a damaged file is not called sound.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError as LibraryError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata
from mcap.records import Message as MessageRecord
from mcap.stream_reader import StreamReader, get_chunk_data_stream

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, summary offset start, summary CRC
_RECORD = struct.Struct("<BQHIQ")  # opcode, length; of a message also channel, sequence, log time
_HEAD, _MESSAGE_HEAD = 9, 9 + 22  # bytes before a record's content, before a message's data
_DAMAGED = (LibraryError, struct.error, ValueError, RuntimeError, OverflowError, zstandard.ZstdError)


class McapError(Exception):
    """The file is not a whole MCAP file; one line, without the path."""


class Message(NamedTuple):
    """One message: log time in ns and the bytes of the channel's encoding."""

    log_time: int
    data: bytes


class Content(NamedTuple):
    """What a file holds: messages of the topics asked for, all channels by topic, metadata and attachments by name."""

    library: str
    messages: dict[str, list[Message]]
    channels: dict[str, Channel]
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]


def read(path: Path, topics: Collection[str]) -> Content:
    """Everything in the file, messages only of `topics`. Raises McapError (damaged, cut off, no MCAP) and OSError."""
    data = path.read_bytes()
    _check_ends(data)
    content = Content("", {topic: [] for topic in topics}, {}, {}, {})
    wanted: dict[int, list[Message]] = {}
    library = ""
    try:
        reader = StreamReader(BytesIO(data), emit_chunks=True, validate_crcs=True, record_size_limit=len(data))
        for record in reader.records:
            if isinstance(record, Chunk):
                _take_chunk(record, content, wanted)
            elif isinstance(record, MessageRecord):
                if (rows := wanted.get(record.channel_id)) is not None:
                    rows.append(Message(record.log_time, record.data))
            elif isinstance(record, Header):
                library = record.library
            else:
                _take(record, content, wanted)
    except _DAMAGED as error:
        raise McapError(f"is corrupt: {error or type(error).__name__}") from error
    return content._replace(library=library)


def _take_chunk(chunk: Chunk, content: Content, wanted: dict[int, list[Message]]) -> None:
    """The chunk's channels and messages, its CRC checked. Five times faster than an object of the library for each."""
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    data = stream.read(size)
    padded = data + bytes(_RECORD.size)  # so that the shortest record at the end can be looked at like any other
    at = 0
    while at < size:
        opcode, length, channel, _, log_time = _RECORD.unpack_from(padded, at)
        end = at + _HEAD + length
        if end > size or (opcode == Opcode.MESSAGE and length < _MESSAGE_HEAD - _HEAD):
            raise ValueError(f"a record of {length} bytes does not fit into its chunk")
        if opcode == Opcode.CHANNEL:
            _take(Channel.read(ReadDataStream(BytesIO(data[at + _HEAD : end]))), content, wanted)
        elif opcode == Opcode.MESSAGE and (rows := wanted.get(channel)) is not None:
            rows.append(Message(log_time, data[at + _MESSAGE_HEAD : end]))
        at = end


def _take(record: Any, content: Content, wanted: dict[int, list[Message]]) -> None:
    """What is not a message: channels, metadata, attachments; records of the summary repeat them."""
    if isinstance(record, Channel):
        content.channels[record.topic] = record
        if record.topic in content.messages:
            wanted[record.id] = content.messages[record.topic]
    elif isinstance(record, Metadata):
        content.metadata[record.name] = record.metadata
    elif isinstance(record, Attachment):
        content.attachments[record.name] = record.data


def _check_ends(data: bytes) -> None:
    """Magic at both ends, and the summary's CRC, which the library leaves alone."""
    if not data:
        raise McapError("is empty")
    if not data.startswith(MAGIC):
        raise McapError(f"expected an MCAP log (it starts with {MAGIC.hex()}), got {data[:8].hex()}")
    if len(data) < 2 * len(MAGIC) + _FOOTER.size or not data.endswith(MAGIC):
        raise McapError(f"is cut off: {len(data)} bytes that do not end with the MCAP magic")
    at = len(data) - len(MAGIC) - _FOOTER.size
    opcode, length, start, _, stored = _FOOTER.unpack_from(data, at)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - 9:
        raise McapError("has no footer: it was cut off while it was written")
    if stored and zlib.crc32(memoryview(data)[start or at : len(data) - len(MAGIC) - 4]) != stored:
        raise McapError(f"is corrupt: its summary does not give the CRC {stored:08x}")
