"""The links by name. A new link is one file in this folder and one line in LINKS; `open_link` imports it when named."""

from __future__ import annotations

from importlib import import_module

from protocol.link import Link, LinkClosed, LinkError

__all__ = ["LINKS", "Link", "LinkClosed", "LinkError", "link_class", "open_link"]

LINKS = {
    "inproc": "protocol.links.inproc:InprocLink",
    "pty": "protocol.links.pty:PtyLink",
    "serial": "protocol.links.serial:SerialLink",
    "udp": "protocol.links.udp:UdpLink",
}


def link_class(name: str) -> type[Link]:
    """The class registered as `name`. Raises LinkError naming the known ones."""
    if name not in LINKS:
        raise LinkError(
            f"link: expected one of {', '.join(sorted(LINKS))}, or a port such as /dev/ttyUSB0, got {name!r}"
        )
    module, _, attribute = LINKS[name].partition(":")
    found: type[Link] = getattr(import_module(module), attribute)
    return found


def open_link(url: str, listen: bool) -> Link:
    """Open one end of a link. The URL names the board's end; `listen` is True on the board, False in the laboratory.

    `pty` | `inproc` | `udp://HOST:PORT` | `serial:///dev/X?baud=N` | `/dev/X`. Raises LinkError with a one-line reason.
    """
    whole = f"serial://{url}" if url.startswith("/dev/") else url
    return link_class(whole.partition(":")[0]).open(whole, listen)
