"""A slow subscription's queue keeps to its bounds, and what it drops is counted and told to who asks."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import metaros
from metaros.cli.top.drops import DropRow, ask, drop_rows
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS
from metaros.node.drop_statistics import drops_key
from metaros.wire import Congestion, QoSProfile
from tests.support.waiting import wait_until

_SENT = 400


def reported(context: metaros.Context, topic: str, fits: Callable[[Any], object] = bool) -> dict[str, Any]:
    """What the context `context` hears about a subscription on `topic`, once it fits."""
    found: list[dict[str, Any]] = []

    def look() -> bool:
        found.extend(row for answer in ask(context.session) for row in json.loads(answer) if row["topic"] == topic)
        return bool(found) and bool(fits(found[-1]))

    wait_until(look)
    return found[-1]


def test_a_slow_subscription_keeps_to_its_depth_and_the_rest_is_reported_as_dropped(here, there):
    with metaros.Node("fast", context=here) as fast, metaros.Node("slow", context=there) as slow:
        subscription = slow.create_subscription(String, "/flood", lambda _: None, QoSProfile(depth=7))
        publisher = fast.create_publisher(String, "/flood", QoSProfile(depth=7, congestion=Congestion.BLOCK))
        wait_until(lambda: publisher.events.matched)
        for number in range(_SENT):
            publisher.publish(String(data=f"{number:04}"))
        row = reported(here, "/flood", lambda row: row["dropped"] == _SENT - 7)
        assert (row["node"], row["depth"], row["queued"], row["lost"]) == ("/slow", 7, 7, 0)
        assert row["queued_bytes"] == 7 * len(b"\0\1\0\0" + b"\5\0\0\0" + b"0000\0")
        assert subscription.dropped == _SENT - 7
        found: list[DropRow] = []
        wait_until(lambda: found.extend(drop_rows(ask(here.session), word="flood")) or found)
        assert (found[0].missing, found[0].queued) == (_SENT - 7, 7)


def test_a_deep_queue_is_bounded_in_bytes(here, there):
    size = LIMITS.ingress_bytes // 16
    with metaros.Node("fast", context=here) as fast, metaros.Node("slow", context=there) as slow:
        got: list[Any] = []
        slow.create_subscription(String, "/big", got.append, QoSProfile(depth=1000), raw=True)
        publisher = fast.create_publisher(String, "/big", QoSProfile(depth=1000, congestion=Congestion.BLOCK))
        wait_until(lambda: publisher.events.matched)
        for _ in range(24):
            publisher.publish(b"\0\1\0\0" + bytes(size))
        row = reported(here, "/big", lambda row: row["dropped"] + row["queued"] == 24)
        assert row["dropped"] > 0
        assert row["queued_bytes"] <= LIMITS.ingress_bytes


def test_without_subscriptions_nobody_answers_and_a_closed_one_is_reported_no_more(island):
    with (
        metaros.Context(domain_id=0, connect=island) as here,
        metaros.Context(domain_id=0, connect=island) as there,
        metaros.Node("bare", context=there, enable_parameters=False, enable_rosout=False) as bare,
    ):
        assert ask(here.session) == []
        with bare.create_subscription(String, "/a", lambda _: None):
            reported(here, "/a")
        wait_until(lambda: ask(here.session) == [b"[]"])
    assert drops_key(3) == "@metaros/3/*/subscriptions"


def test_of_a_dedicated_ring_nothing_is_known_but_its_losses(here):
    with metaros.Node("a", context=here) as node:
        node.create_subscription(String, "/ring", lambda _: None, 3, dedicated=True)
        (row,) = (row for row in here.drops.rows() if row["topic"] == "/ring")
    assert (row["depth"], row["queued"], row["queued_bytes"]) == (3, None, None)
