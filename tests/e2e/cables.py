"""A serial cable between two programs of this machine, and who says what on it."""

from __future__ import annotations

import os
import select
import threading
import tty

from protocol.codec import StreamDecoder


class Cable:
    """Two ptys whose far sides are joined: what goes into `lab` comes out of `board`, and the other way round."""

    def __init__(self) -> None:
        self._masters: list[int] = []
        self._held: list[int] = []
        paths = []
        for _ in range(2):
            master, slave = os.openpty()
            tty.setraw(slave)
            self._masters.append(master)
            self._held.append(slave)
            paths.append(os.ttyname(slave))
        self.lab, self.board = paths
        self.to_board = StreamDecoder()
        self.types: list[int] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._relay)

    def start(self) -> None:
        """Let go of the near sides, which somebody has to have opened by now or will soon."""
        for slave in self._held:
            os.close(slave)
        self._thread.start()

    def _relay(self) -> None:
        lab, board = self._masters
        while not self._over.is_set():
            for master in select.select(self._masters, [], [], 0.02)[0]:
                try:
                    data = os.read(master, 65536)
                except OSError:  # nobody has the near side open at the moment
                    self._over.wait(0.005)
                    continue
                if master == lab:
                    self.types += [packet[1] for packet in self.to_board.feed(data)]
                os.write(board if master == lab else lab, data)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        for master in self._masters:
            os.close(master)
