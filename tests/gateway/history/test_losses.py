"""Losses as answers hold them: those that lie close together as one, and never too many."""

from __future__ import annotations

from gateway.history.losses import MAX_LOSSES, Loss, loss_view, merged_losses


def loss(from_ns: int, to_ns: int, *, count: int = 1, reason: str = "outbox_full", topic: str | None = "/a") -> Loss:
    return Loss(from_ns=from_ns, to_ns=to_ns, count=count, reason=reason, topic=topic)


def test_close_ones_of_a_topic_and_reason_are_one() -> None:
    losses = [loss(100, 200, count=5), loss(0, 50, count=2), loss(251, 260), loss(120, 130, topic="/b")]
    assert merged_losses(losses, within_ns=50) == [loss(0, 200, count=7), loss(120, 130, topic="/b"), loss(251, 260)]
    assert merged_losses([loss(0, 9), loss(3, 5, count=4)]) == [loss(0, 9, count=5)]
    assert merged_losses([loss(0, 9), loss(3, 5, reason="evicted")]) == [loss(0, 9), loss(3, 5, reason="evicted")]
    assert merged_losses([]) == []


def test_the_newest_stay() -> None:
    many = [loss(10 * n, 10 * n + 1) for n in range(MAX_LOSSES + 5)]
    assert merged_losses(many) == many[5:]


def test_view() -> None:
    shown = loss_view(loss(1_500_000, 2_000_000, count=3, topic=None))
    assert shown == {"from_ms": 1.5, "to_ms": 2.0, "count": 3, "reason": "outbox_full", "topic": None}
