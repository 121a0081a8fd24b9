"""Which targets are due, and how much of each is leased."""

from __future__ import annotations

from gateway.automation.queue.due_targets import DueTargets
from gateway.store.automation.deliveries import LeaseRequest, Ready


def notify(*targets: str, due_ns: int = 0, most: int = 100) -> DueTargets:
    """An agenda with something due for these."""
    due_targets = DueTargets(most=most)
    due_targets.note(Ready("k", target, due_ns) for target in targets)
    return due_targets


def test_room_is_shared_and_whoever_was_served_comes_last() -> None:
    due_targets = notify("a", "b", "c")
    lease_requests = due_targets.lease_requests("k", now_ns=1, room=7, of_target=lambda target: 100)
    assert lease_requests == [LeaseRequest("k", "a", 3), LeaseRequest("k", "b", 2), LeaseRequest("k", "c", 2)]
    assert len(due_targets) == 0
    due_targets = notify("a", "b", "c")
    (first,) = due_targets.lease_requests("k", now_ns=1, room=1, of_target=lambda target: 100)
    due_targets.note([Ready("k", "a", 0)])
    (second,) = due_targets.lease_requests("k", now_ns=1, room=1, of_target=lambda target: 100)
    assert (first.target, second.target) == ("a", "b")


def test_a_target_without_room_keeps_its_place_and_leaves_its_share() -> None:
    due_targets = notify("a", "b")
    assert due_targets.lease_requests("k", now_ns=1, room=9, of_target=lambda t: 0 if t == "a" else 100) == [
        LeaseRequest("k", "b", 9)
    ]
    assert due_targets.lease_requests("k", now_ns=1, room=9, of_target=lambda target: 5) == [LeaseRequest("k", "a", 5)]


def test_only_what_is_due_and_of_the_kind() -> None:
    due_targets = notify("a", due_ns=50)
    due_targets.note([Ready("other", "a", 0), Ready("k", "a", 70), Ready("k", "b", 90)])
    assert due_targets.lease_requests("k", now_ns=49, room=9, of_target=lambda target: 9) == []
    assert due_targets.next_ns(49) == 50
    assert due_targets.next_ns(50) == 90
    assert due_targets.lease_requests("k", now_ns=50, room=9, of_target=lambda target: 9) == [LeaseRequest("k", "a", 9)]
    assert due_targets.lease_requests("other", now_ns=50, room=0, of_target=lambda target: 9) == []


def test_a_full_table_takes_news_of_those_it_has_only() -> None:
    due_targets = notify("a", "b", due_ns=9, most=2)
    due_targets.note([Ready("k", "c", 0), Ready("k", "b", 3)])
    assert [
        request.target for request in due_targets.lease_requests("k", now_ns=9, room=9, of_target=lambda target: 9)
    ] == ["a", "b"]
