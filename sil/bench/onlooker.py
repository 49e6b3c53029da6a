"""A viewer of a live run, as a process: `python -m sil.bench.onlooker PORT reads|stuck`.

It tries for a minute to connect, subscribes to every topic, and then throws away what comes, or does not read at all,
until the run closes the connection or the process is ended. No library: a WebSocket's handshake and one frame.
"""

from __future__ import annotations

import json
import socket
import sys
import time

SUBPROTOCOL = "foxglove.sdk.v1"
TRIES_S = 60.0
TOPICS = 64  # channels are numbered from 1 by who serves them; unknown ones are refused one by one
BLOCK = 1 << 16
STUCK_BYTES = 1  # of receive buffer: the kernel makes the least of it


def main() -> None:
    """Look on."""
    port, stuck = int(sys.argv[1]), sys.argv[2] == "stuck"
    with connected(port, stuck) as connection:
        connection.sendall(handshake(port))
        connection.recv(BLOCK)
        time.sleep(0.2)  # channels are announced before they can be asked for
        connection.sendall(subscription())
        while stuck:
            time.sleep(1.0)
        while connection.recv(BLOCK):
            pass


def connected(port: int, stuck: bool) -> socket.socket:
    """As soon as somebody listens."""
    give_up = time.monotonic() + TRIES_S
    while True:
        connection = socket.socket()
        if stuck:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, STUCK_BYTES)
        try:
            connection.connect(("127.0.0.1", port))
            return connection
        except ConnectionRefusedError:
            connection.close()
            if time.monotonic() > give_up:
                raise
            time.sleep(0.05)


def handshake(port: int) -> bytes:
    """The request of RFC 6455; nobody here checks the answer to its key."""
    lines = (
        "GET / HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Protocol: {SUBPROTOCOL}",
    )
    return "".join(f"{line}\r\n" for line in (*lines, "")).encode()


def subscription() -> bytes:
    """One text frame, masked with zeros."""
    wanted = [{"id": number, "channelId": number} for number in range(1, TOPICS + 1)]
    payload = json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()
    return b"\x81\xfe" + len(payload).to_bytes(2, "big") + bytes(4) + payload


if __name__ == "__main__":
    main()
