"""What viewers connect to: a Foxglove WebSocket with a channel per topic, in the schemas and bytes of the log.

Nothing here waits for a viewer: each has a queue of BACKLOG messages, whose oldest is dropped where it does not read
fast enough. The library counts no such drops; that there were some is known from its own log (`behind`).
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping

import foxglove
from foxglove.websocket import Capability, ChannelView, Client, ServerListener

BACKLOG = 1024  # messages a viewer: about two seconds at full rate, 0.3 MB
KEPT_TOPIC = "/scene"  # written when it changes only: the last one is repeated for who comes later
MOST_ERRORS = 20  # lines about viewers that send nonsense
SUBSCRIBES_S = 1.0  # on a busy machine
CLOSES_S = 1.0  # viewers that read get their goodbye within this time
VIEWER = "viewer"  # said on stdout when the first one has subscribed to something


class Server(ServerListener):
    """A Writer as sil.sinks.mcap_rows needs it, whose messages go to viewers. Raises RuntimeError: cannot listen."""

    def __init__(self, host: str, port: int, name: str) -> None:
        self._log = _LibraryLog()
        self._context = foxglove.Context()
        self._schemas: list[foxglove.Schema] = []
        self._channels: list[foxglove.Channel] = []
        self._topics: dict[str, int] = {}
        self._kept: tuple[int, bytes] | None = None  # channel and message
        self._newcomers: deque[int] = deque(maxlen=1000)  # filled by the library's threads
        self._viewers: set[int] = set()  # all that ever subscribed
        self._wanted: set[str] = set()  # topics that anybody ever subscribed to
        self._t_ns = 0
        self.messages = 0
        self._server = foxglove.start_server(
            name=name,
            host=host,
            port=port,
            capabilities=[Capability.Time],
            server_listener=self,
            context=self._context,
            message_backlog_size=BACKLOG,
        )

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._server.port

    @property
    def viewers(self) -> int:
        """How many connections have subscribed to something, by now."""
        return len(self._viewers)

    @property
    def behind(self) -> bool:
        """A viewer did not read fast enough, and has missed messages."""
        return self._log.outbox_was_full

    # -- the writer ------------------------------------------------------------------------------------------------

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        self._schemas.append(foxglove.Schema(name=name, encoding=encoding, data=data))
        return len(self._schemas) - 1

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: Mapping[str, str] | None = None
    ) -> int:
        """A topic that both logs have (/event) is one channel."""
        if topic not in self._topics:
            self._topics[topic] = len(self._channels)
            channel = foxglove.Channel(
                topic,
                message_encoding=message_encoding,
                schema=self._schemas[schema_id],
                metadata=dict(metadata or {}),
                context=self._context,
            )
            self._channels.append(channel)
            self._let_subscribe(topic)
        return self._topics[topic]

    def _let_subscribe(self, topic: str) -> None:
        """A channel that is new while somebody looks has its first message soon: let them ask for it before."""
        give_up = time.monotonic() + SUBSCRIBES_S
        while self._viewers and topic not in self._wanted and time.monotonic() < give_up:
            time.sleep(0.005)

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        channel = self._channels[channel_id]
        if channel.topic() == KEPT_TOPIC:
            self._kept = channel_id, data
        channel.log(data, log_time=log_time)
        self.messages += 1

    def add_metadata(self, name: str, data: Mapping[str, str]) -> None:
        """A viewer knows no metadata."""

    def add_attachment(self, create_time: int, log_time: int, name: str, media_type: str, data: bytes) -> None:
        """Nor attachments."""

    # -- time and newcomers ----------------------------------------------------------------------------------------

    def time(self, t_ns: int) -> None:
        """It is t_ns, of simulated time."""
        self._t_ns = t_ns
        self._server.broadcast_time(t_ns)

    def welcome(self) -> None:
        """Repeat what was said once, for those who have subscribed since; the others know it already."""
        if self._newcomers and self._kept is not None:
            self._newcomers.clear()
            channel_id, data = self._kept
            self._channels[channel_id].log(data, log_time=self._t_ns)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        first = not self._viewers
        self._viewers.add(client.id)
        self._wanted.add(channel.topic)
        if channel.topic == KEPT_TOPIC:
            self._newcomers.append(client.id)
        if first:
            print(VIEWER, flush=True)

    def stop(self) -> None:
        """Close all connections. The library would wait for a viewer that is stuck until it reads again: we do not, and
        its threads end with the process."""
        closing = threading.Thread(target=self._server.stop, daemon=True)
        closing.start()
        closing.join(CLOSES_S)


class _LibraryLog(logging.Handler):
    """What the library says of itself: errors go to our stderr, one kind of message is what we have to know."""

    def __init__(self) -> None:
        super().__init__()
        self.outbox_was_full = False
        self._errors = 0
        logger = logging.getLogger("foxglove")
        logger.propagate = False
        logger.addHandler(self)
        logger.setLevel(logging.INFO)
        logging.getLogger().addHandler(logging.NullHandler())  # the library is not to set up one that prints
        foxglove.set_log_level("INFO")

    def emit(self, record: logging.LogRecord) -> None:
        if record.name.endswith("send_lossy"):
            self.outbox_was_full = True
        elif record.levelno >= logging.ERROR and self._errors < MOST_ERRORS:
            self._errors += 1
            print(record.getMessage()[:500], file=sys.stderr, flush=True)
