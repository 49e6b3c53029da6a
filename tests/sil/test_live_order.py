"""Where viewers connect, as --live, --live-at and --live-wait say it."""

from __future__ import annotations

import pytest

from sil.live_view import LiveOrder
from sil.trouble import UsageError
from sil.verbs.options import live_order


def test_each_of_the_options_asks_for_the_view():
    assert live_order(False, None, None) is None
    assert live_order(True, None, None) == LiveOrder("127.0.0.1", 8765, 0.0)
    assert live_order(False, "0.0.0.0:0", None) == LiveOrder("0.0.0.0", 0, 0.0)
    assert live_order(False, "[::1]:9", 5.0) == LiveOrder("::1", 9, 5.0)
    assert live_order(False, None, 0.0) == LiveOrder("127.0.0.1", 8765, 0.0)


@pytest.mark.parametrize("place", ["8765", "127.0.0.1:", "127.0.0.1:port", "127.0.0.1:99999", ":8765", "", "a:²"])
def test_an_address_that_is_none(place):
    with pytest.raises(UsageError, match=r"^--live-at: expected HOST:PORT such as 127.0.0.1:8765, port 0 to 65535"):
        live_order(True, place, None)
