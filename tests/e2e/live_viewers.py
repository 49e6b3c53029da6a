"""Viewers of a live run: one that reads, one that is stuck, one that talks nonsense."""

from __future__ import annotations

import json
import re
import socket
import struct
import subprocess
import threading
from collections import defaultdict
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

PROTOCOL = "foxglove.sdk.v1"
MESSAGE, TIME = 1, 2
URL = re.compile(r"ws://[^ ]+")


def address_of(process: subprocess.Popen[str]) -> tuple[str, int]:
    """Where this `sil run --live` says that viewers connect."""
    assert process.stderr is not None
    for line in process.stderr:
        if found := URL.search(line):
            host, _, port = found[0].removeprefix("ws://").rpartition(":")
            return host, int(port)
    raise AssertionError(process.communicate())


class Viewer(threading.Thread):
    """Subscribes to everything and keeps it. `messages[topic]` are (log time in ns, bytes)."""

    def __init__(self, address: tuple[str, int]) -> None:
        super().__init__(daemon=True)
        self._url = f"ws://{address[0]}:{address[1]}"
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: defaultdict[str, list[tuple[int, bytes]]] = defaultdict(list)
        self.times_ns: list[int] = []
        self.late_ns: list[int] = []  # by how much a message of /truth was off from the time told before it
        self.has_some = threading.Event()
        self.start()

    def run(self) -> None:
        with connect(self._url, subprotocols=[PROTOCOL], max_size=None) as connection:
            self._topics: dict[int, str] = {}
            try:
                for message in connection:
                    self._take(connection, message)
            except ConnectionClosed:
                return

    def _take(self, connection: Any, message: str | bytes) -> None:
        if isinstance(message, str):
            self._told(connection, json.loads(message))
        elif message[0] == TIME:
            self.times_ns.append(struct.unpack_from("<Q", message, 1)[0])
        else:
            number, t_ns = struct.unpack_from("<IQ", message, 1)
            topic = self._topics[number]
            self.messages[topic].append((t_ns, message[13:]))
            if topic == "/truth":
                self.late_ns.append(t_ns - self.times_ns[-1] if self.times_ns else 0)
                self.has_some.set()

    def _told(self, connection: Any, message: dict[str, Any]) -> None:
        if message["op"] != "advertise":
            return
        for channel in message["channels"]:
            self.channels[channel["topic"]] = channel
            self._topics[len(self._topics)] = channel["topic"]
            wanted = {"id": len(self._topics) - 1, "channelId": channel["id"]}
            connection.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))


def stuck(address: tuple[str, int]) -> socket.socket:
    """A viewer that subscribes to everything, and never reads another byte into a buffer of the least size."""
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    raw.connect(address)
    with_keys = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
    version = f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n"
    raw.sendall(f"GET / HTTP/1.1\r\nHost: {address[0]}:{address[1]}\r\n{with_keys}{version}".encode())
    assert raw.recv(20).startswith(b"HTTP/1.1 101")
    wanted = [{"id": number, "channelId": number} for number in range(1, 30)]
    raw.sendall(frame(1, json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()))
    return raw


def talks_nonsense(address: tuple[str, int]) -> None:
    """Bytes that are no HTTP, then frames that are no message, then a length that nobody has."""
    with socket.create_connection(address) as raw:
        raw.sendall(bytes(range(256)) * 40)
    raw = stuck(address)
    for payload in (b"{", b'{"op": "nobody knows"}', b'{"op": "subscribe", "subscriptions": 5}', b"\xff\xfe"):
        raw.sendall(frame(1, payload))
    raw.sendall(frame(2, b"\xff" + bytes(1000)))
    raw.sendall(b"\x82\xff" + b"\xff" * 8 + bytes(4))
    raw.close()


def frame(opcode: int, payload: bytes) -> bytes:
    """One masked frame of a WebSocket; the mask is zero."""
    length = bytes((0x80 | len(payload),)) if len(payload) < 126 else b"\xfe" + len(payload).to_bytes(2, "big")
    return bytes((0x80 | opcode,)) + length + bytes(4) + payload
