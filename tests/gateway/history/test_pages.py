"""Pages of messages: bounded in number and bytes, and a cursor that goes on where the page ended."""

from __future__ import annotations

import base64
from collections.abc import Callable

import pytest

from gateway.domain.decoder import Decoder
from gateway.errors import InvalidRequestError
from gateway.history.cursor import read_cursor, write_cursor
from gateway.history.messages import MessageKey
from gateway.history.pages import PageRequest, message_facts, read_page
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from metaros.cdr import codec
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS
from tests.gateway.history.source import EngineSource
from tests.gateway.store.samples import run_write

PLACES = [(0, 0, 0, 0), (-5, 1, 2**64 - 1, 2**63), (2**62, (1 << 32) - 1, 7, 9)]


def request(*, limit: int = 7, newest_first: bool = False, after: MessageKey | None = None) -> PageRequest:
    return PageRequest(
        robot_id="r1",
        topics=("/events", "/other"),
        start_ns=0,
        end_ns=1 << 60,
        limit=limit,
        newest_first=newest_first,
        after=after,
    )


def test_cursors_say_where() -> None:
    for place in PLACES:
        for newest_first in (False, True):
            text = write_cursor(place, newest_first=newest_first)
            assert read_cursor(text, newest_first=newest_first) == place
            with pytest.raises(InvalidRequestError, match="other order"):
                read_cursor(text, newest_first=not newest_first)


def test_texts_that_are_no_cursors() -> None:
    for text in ("", "x", "AAAA", "é", "a" * 100, "=" * 44, write_cursor(PLACES[0], newest_first=True)[:-2]):
        with pytest.raises(InvalidRequestError, match="cursor"):
            read_cursor(text, newest_first=False)


@pytest.mark.parametrize("newest_first", [False, True])
def test_pages_one_after_another_have_every_message_once(
    engine: StoreEngine, source: Callable[..., EngineSource], newest_first: bool
) -> None:
    """Two topics with the same stamps; what arrives meanwhile where the pages have been changes nothing."""
    writes = [run_write(1 + 10 * n, [b"x"] * 10) for n in range(3)]
    writes.append(run_write(1, [b"y"] * 30, stream_id=8, topic="/other"))
    committer = Committer(engine)
    committer.commit(writes, now_ns=1)
    found, after = [], None
    for _ in range(20):
        page = read_page(source(), request(newest_first=newest_first, after=after))
        found += page.messages
        if page.next is None:
            break
        assert len(page.messages) == 7
        after = read_cursor(page.next, newest_first=newest_first)
        if len(found) == 14:
            early = 10_000 if newest_first else 0
            committer.commit([run_write(1, [b"z"], stream_id=9, topic="/other", stamp_ns=early)], now_ns=2)
    places = [message.place for message in found]
    assert places == sorted(set(places), reverse=newest_first)
    assert len(places) == 60


def test_a_page_ends_at_its_bytes(engine: StoreEngine, source: Callable[..., EngineSource]) -> None:
    large = bytes(LIMITS.history_page_bytes // 2)
    writes = [run_write(1, [large, large, b"small"]), run_write(4, [bytes(LIMITS.history_page_bytes + 1)])]
    Committer(engine).commit(writes, now_ns=1)
    pages, after = [], None
    while not pages or after is not None:
        page = read_page(source(), request(after=after))
        pages.append([message.seq for message in page.messages])
        after = read_cursor(page.next, newest_first=False) if page.next else None
    assert pages == [[1, 2], [3], [4]]


def test_messages_as_json_and_as_published(engine: StoreEngine) -> None:
    payload = codec(String).encode(String(data="hello"))
    Committer(engine).commit([run_write(1, [payload, b"broken"])], now_ns=1)
    good, bad = read_page(EngineSource(engine), request()).messages
    facts = message_facts(good, None)
    assert base64.b64decode(facts["cdr"]) == payload
    assert (facts["seq"], facts["stamp_ns"], facts["epoch"]) == (1, 1001, "fffffffffffffffd")
    assert (facts["class"], facts["type"], facts["topic"]) == ("event", "std_msgs/msg/String", "/events")
    assert message_facts(good, Decoder())["message"] == {"data": "hello"}
    broken = message_facts(bad, Decoder())
    assert (broken["message"], broken["error"]["code"]) == (None, "malformed_cdr")
