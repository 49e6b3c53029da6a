"""Boards that we start ourselves: a process on the other end of a pty or of UDP on loopback, watched while it lives.

The process is `python -m MODULE --link URL --parent PID [--once]`. It says one line on its standard output, `listening
URL`, and from then on it speaks frames. Whatever it has to say to a person goes to its standard error, which is the
log. Where it cannot start as it was asked to, it ends with exit code 2 before that line, and its last line says why.
"""

from __future__ import annotations

import importlib.util
import os
import select
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO, TYPE_CHECKING, ClassVar

from protocol.links import Link, open_link
from sil.trouble import EXIT_USAGE, LinkFailure, UsageError

if TYPE_CHECKING:
    from sil.boards import BoardOrder

STOP_S = 1.0


class LaunchedBoard:
    """A `BoardHost` of a process of ours. A kind of board is a class with a `module` and, if need be, `options`.

    `what`: the process, in the words of a message that says what became of it. `tells_incidents`: its standard error
    says what happened to the board, and nothing else.
    """

    module: ClassVar[str]
    what: ClassVar[str] = "board process"
    start_s: ClassVar[float] = 30.0  # within this time it listens
    tells_incidents: ClassVar[bool] = False

    def __init__(self, order: BoardOrder) -> None:
        scheme = order.link_url.partition(":")[0]
        if scheme not in ("pty", "udp"):
            raise UsageError(
                f"link: a board process is reached over pty or udp, got {order.link_url!r}; known: pty, udp"
            )
        self._log: IO[bytes] = open(order.log, "w+b") if order.log else tempfile.TemporaryFile()  # noqa: SIM115
        self._child: subprocess.Popen[bytes] | None = None
        self.link: Link = None  # type: ignore[assignment]  # until the child listens
        try:
            self.link = self._over_pty(order) if scheme == "pty" else self._over_udp(order)
        except BaseException:
            self.close()
            raise

    def options(self, order: BoardOrder) -> list[str]:
        """More arguments for the module, after --link, --parent and, for a single session, --once."""
        return []

    @property
    def pid(self) -> int | None:
        return self._child.pid if self._child is not None else None

    def check_alive(self) -> None:
        assert self._child is not None
        code = self._child.poll()
        if code is not None:
            raise LinkFailure(f"board: the {self.what} ended with {_describe(code)}{self._colon_last_words()}")

    def post_mortem(self, error: Exception) -> str:
        """A process that is about to end is given a moment to say why; one that lives on may have told it already."""
        assert self._child is not None
        try:
            self._child.wait(STOP_S)
            self.check_alive()
        except subprocess.TimeoutExpired:
            return f"{error}{self._colon_last_words()}" if self.tells_incidents else str(error)
        except LinkFailure as failure:
            return str(failure)
        return str(error)

    def close(self) -> None:
        """Unplug; a board that was told STOP, or whose pty is gone, ends by itself, and it has no state to lose."""
        if self.link is not None:
            self.link.close()
        child = self._child
        if child is not None:
            try:
                child.wait(STOP_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
            if child.stdout:
                child.stdout.close()
        self._log.close()

    def _over_pty(self, order: BoardOrder) -> Link:
        link = open_link("pty", listen=False)
        try:
            self._launch(order, link.peer_url)
            self._listening()
        except BaseException:
            link.close()
            raise
        return link

    def _over_udp(self, order: BoardOrder) -> Link:
        url = "udp://127.0.0.1:0" if order.link_url in ("udp", "udp:", "udp://") else order.link_url
        self._launch(order, url)
        return open_link(self._listening(), listen=False)

    def _launch(self, order: BoardOrder, url: str) -> None:
        command = [sys.executable, "-P", "-m", self.module, "--link", url, "--parent", str(os.getpid())]
        once = ["--once"] if order.once else []
        self._child = subprocess.Popen(
            [*command, *once, *self.options(order)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env=child_environment(),
            start_new_session=True,  # Ctrl-C in the terminal is the laboratory's to handle
        )

    def _listening(self) -> str:
        """The URL the child says it listens on: its one line, after which its standard output is its standard error."""
        child = self._child
        assert child is not None and child.stdout is not None
        poller = select.poll()
        poller.register(child.stdout, select.POLLIN | select.POLLHUP)
        if not poller.poll(self.start_s * 1000):
            raise LinkFailure(f"board: the {self.what} did not start within {self.start_s:g} s")
        line = child.stdout.readline().decode(errors="replace").strip()
        if not line.startswith("listening "):
            said = f"board: the {self.what} said {line!r}, expected 'listening URL'"
            reason = self.post_mortem(LinkFailure(said))
            raise UsageError(self._last_words()) if self._refused() else LinkFailure(reason)
        return line.removeprefix("listening ")

    def _refused(self) -> bool:
        """It has ended because it cannot start as it was asked to, and has said why."""
        assert self._child is not None
        return self._child.returncode == EXIT_USAGE and bool(self._last_words())

    def _colon_last_words(self) -> str:
        words = self._last_words()
        return f": {words}" if words else ""

    def _last_words(self) -> str:
        """The last line of its stderr: the exception, when the law raised one; "" when it said nothing."""
        self._log.flush()
        self._log.seek(0)
        lines = [line for line in self._log.read().decode(errors="replace").splitlines() if line.strip()]
        return lines[-1].strip() if lines else ""


def child_environment() -> dict[str, str]:
    """With `python -P`, a child runs the package that this process runs, not what lies in its working directory."""
    spec = importlib.util.find_spec("firmware_sim")
    assert spec is not None and spec.origin is not None
    home = str(Path(spec.origin).parent.parent)
    paths = [home, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _describe(code: int) -> str:
    return f"signal {-code}" if code < 0 else f"exit code {code}"
