"""The pure monitors: deadlines, leases, liveliness, peers. Times and tokens are given; nothing waits."""

from __future__ import annotations

import dataclasses
import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.node.events import Matched, QoSIncompatible, TypeMismatch
from metaros.node.events.deadline import DeadlineMonitor
from metaros.node.events.liveliness import Lease, LivelinessMonitor
from metaros.node.events.peers import Peers
from metaros.node.events.publisher_monitor import lease_s
from metaros.wire import Durability, Liveliness, QoSProfile, Reliability, incompatibilities
from metaros.wire.liveliness_tokens import EndpointToken, NodeToken
from metaros.wire.qos import INFINITE_NS

# -- deadline ----------------------------------------------------------------------------------------------------------


def test_a_deadline_starts_with_the_first_sample_and_counts_whole_periods():
    clock = ManualClock(monotonic_s=0.0)
    monitor = DeadlineMonitor(0.5)
    clock.advance(100.0)
    assert monitor.check(clock.monotonic_s()) == 0
    assert monitor.next_check_s(clock.monotonic_s()) == 100.5
    monitor.mark(clock.monotonic_s())
    clock.advance(0.49)
    assert monitor.check(clock.monotonic_s()) == 0
    clock.advance(0.01)
    assert monitor.check(clock.monotonic_s()) == 1
    assert monitor.check(clock.monotonic_s()) == 0
    clock.advance(1.75)
    assert monitor.check(clock.monotonic_s()) == 3
    assert monitor.next_check_s(clock.monotonic_s()) == 102.5
    monitor.mark(clock.monotonic_s())
    assert monitor.next_check_s(clock.monotonic_s()) == 102.75
    assert monitor.total == 4


def test_a_sample_exactly_on_time_is_in_time_and_a_late_one_is_counted_without_a_check_between():
    monitor = DeadlineMonitor(1.0)
    for now_s in (0.0, 1.0, 2.0, 3.0):
        monitor.mark(now_s)
    assert monitor.check(3.0) == 0
    monitor.mark(4.5)
    monitor.mark(4.6)
    assert monitor.check(4.6) == 1


def test_an_excused_period_does_not_count():
    monitor = DeadlineMonitor(1.0)
    monitor.excuse(5.0)
    assert monitor.check(100.0) == 0
    monitor.mark(100.0)
    monitor.excuse(103.5)
    assert monitor.check(103.5) == 0
    assert monitor.next_check_s(103.5) == 104.5
    assert monitor.check(104.5) == 1


@settings(max_examples=50)
@given(st.floats(0.001, 100.0), st.lists(st.floats(0.0, 1000.0), min_size=1, max_size=30))
def test_looking_more_often_never_changes_how_many_were_missed(period_s, gaps):
    lazy, keen = DeadlineMonitor(period_s), DeadlineMonitor(period_s)
    now_s = 0.0
    for gap in gaps:
        lazy.mark(now_s)
        keen.mark(now_s)
        keen.check(now_s + gap / 2)
        now_s += gap
        assert keen.next_check_s(now_s) >= 0.0
    lazy.check(now_s)
    keen.check(now_s)
    assert abs(lazy.total - keen.total) <= len(gaps)  # a period's end may be rounded onto now
    assert lazy.total <= sum(gaps) / period_s + len(gaps)


@settings(max_examples=50)
@given(st.floats(1e-6, 1e3), st.floats(0.0, 1e9))
def test_the_next_check_is_never_in_the_past_after_a_check(period_s, now_s):
    monitor = DeadlineMonitor(period_s)
    monitor.mark(0.0)
    monitor.check(now_s)
    assert monitor.next_check_s(now_s) >= now_s


# -- liveliness --------------------------------------------------------------------------------------------------------


def test_a_lease_is_lost_once_and_comes_back():
    lease = Lease(1.0, 10.0)
    assert not lease.check(10.9)
    assert lease.check(11.0)
    assert not lease.check(50.0)
    assert lease.next_check_s(50.0) == 51.0
    lease.renew(60.0)
    assert (lease.alive, lease.lost) == (True, 1)
    assert lease.next_check_s(60.0) == 61.0
    assert lease.check(62.0)
    assert lease.lost == 2


def test_publishers_by_token_are_alive_until_they_leave():
    monitor = LivelinessMonitor("/t")
    event = monitor.add(b"a", "/a", None, 0.0)
    assert event is not None
    assert (event.node, event.alive, event.alive_change, event.not_alive) == ("/a", 1, 1, 0)
    assert monitor.add(b"a", "/a", None, 0.0) is None
    assert monitor.check(1e9) == []
    assert monitor.next_check_s() is None
    assert monitor.renew(b"a", 1.0) is None
    event = monitor.discard(b"a")
    assert event is not None
    assert (event.alive, event.alive_change, event.not_alive, event.not_alive_change) == (0, -1, 0, 0)
    assert monitor.discard(b"a") is None


def test_publishers_with_a_lease_fall_silent_and_wake():
    monitor = LivelinessMonitor("/t")
    monitor.add(b"a", "/a", 1.0, 0.0)
    monitor.add(b"b", "/b", 1.0, 0.0)
    monitor.add(b"c", "/c", 5.0, 0.0)
    assert monitor.next_check_s() == 1.0
    events = monitor.check(1.5)
    assert [(e.node, e.alive, e.alive_change, e.not_alive, e.not_alive_change) for e in events] == [
        ("/a", 2, -1, 1, 1),
        ("/b", 1, -1, 2, 1),
    ]
    woke = monitor.renew(b"a", 2.0)
    assert woke is not None
    assert (woke.alive, woke.alive_change, woke.not_alive, woke.not_alive_change) == (2, 1, 1, -1)
    left = monitor.discard(b"b")
    assert left is not None
    assert (left.alive, left.alive_change, left.not_alive, left.not_alive_change) == (2, 0, 0, -1)
    assert monitor.renew(b"unknown", 2.0) is None


@settings(max_examples=50)
@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from(("add", "gone", "heard", "wait"))), max_size=60))
def test_liveliness_counts_always_add_up(steps):
    monitor, alive, not_alive = LivelinessMonitor("/t"), 0, 0
    for now_s, (name, step) in enumerate(steps):
        gid = name.encode()
        if step == "wait":
            events = monitor.check(float(now_s))
        else:
            event = {
                "add": lambda g=gid, t=float(now_s): monitor.add(g, "/n", 3.0, t),
                "gone": lambda g=gid: monitor.discard(g),
                "heard": lambda g=gid, t=float(now_s): monitor.renew(g, t),
            }[step]()
            events = [] if event is None else [event]
        for event in events:
            alive, not_alive = alive + event.alive_change, not_alive + event.not_alive_change
            assert (event.alive, event.not_alive) == (alive, not_alive)
        assert (monitor.alive, monitor.not_alive) == (alive, not_alive)
        assert min(alive, not_alive) >= 0


def test_only_manual_liveliness_with_a_finite_lease_must_be_received():
    assert lease_s(QoSProfile()) is None
    assert lease_s(QoSProfile(lease_ns=10**9)) is None
    assert lease_s(QoSProfile(liveliness=Liveliness.MANUAL_BY_TOPIC)) is None
    assert lease_s(QoSProfile(liveliness=Liveliness.MANUAL_BY_TOPIC, lease_ns=10**9)) == 1.0


# -- peers -------------------------------------------------------------------------------------------------------------

HASHES = ("RIHS01_" + "0" * 64, "RIHS01_" + "1" * 64)


def endpoint(
    kind: str, *, node: str = "n", eid: int = 1, qos: QoSProfile | None = None, **changes: str
) -> EndpointToken:
    owner = NodeToken(0, "ab", 0, node)
    text = (qos or QoSProfile()).encode()
    fields = {"topic": "/t", "type_name": "std_msgs/msg/String", "type_hash": HASHES[0], "qos_text": text, **changes}
    return EndpointToken(owner, eid, kind, **fields)  # type: ignore[arg-type]


def test_peers_come_go_and_come_back():
    peers = Peers(endpoint("MS", node="me"))
    talker = endpoint("MP", node="talker", eid=2)
    assert peers.add(endpoint("MS", node="other", eid=3)) is None
    assert peers.add(endpoint("MP", eid=4, topic="/else")) is None
    (_, event), again = peers.add(talker), peers.add(talker)
    assert event == Matched(topic="/t", node="/talker", total=1, change=1, current=1, current_change=1)
    assert again is None
    assert peers.node_of(talker.gid) == "/talker"
    _, event = peers.discard(talker)
    assert event == Matched(topic="/t", node="/talker", total=1, change=0, current=0, current_change=-1)
    assert peers.discard(talker) is None
    _, event = peers.add(talker)
    assert (event.total, event.current) == (2, 1)
    assert peers.node_of(b"?") == ""


def test_peers_that_do_not_fit_are_counted_apart():
    peers = Peers(endpoint("MS", node="me", qos=QoSProfile(deadline_ns=10**9)))
    _, event = peers.add(endpoint("MP", node="slow", eid=2))
    assert isinstance(event, QoSIncompatible)
    assert (event.node, event.total, event.policies) == ("/slow", 1, ("deadline",))
    assert event.reason == "/t: subscription /me and publisher /slow: deadline: none is offered, 1 s requested"
    _, event = peers.add(endpoint("MP", node="old", eid=3, type_hash=HASHES[1]))
    assert isinstance(event, TypeMismatch)
    assert (event.node, event.type_hash, event.peer_type_hash) == ("/old", *HASHES)
    _, event = peers.add(endpoint("MP", node="odd", eid=4, type_name="std_msgs/msg/Bool"))
    assert (event.total, event.peer_type_name) == (2, "std_msgs/msg/Bool")
    assert (peers.matched, peers.incompatible_total, peers.mismatched_total) == (0, 1, 2)
    assert [peers.discard(token)[1] for token in peers.tokens()] == [None, None, None]


# -- offered and requested ---------------------------------------------------------------------------------------------

DURATIONS = st.one_of(st.just(INFINITE_NS), st.just(0), st.integers(1, 10**10))
PROFILES = st.builds(
    QoSProfile,
    reliability=st.sampled_from((Reliability.RELIABLE, Reliability.BEST_EFFORT)),
    durability=st.sampled_from((Durability.VOLATILE, Durability.TRANSIENT_LOCAL)),
    deadline_ns=DURATIONS,
    lifespan_ns=DURATIONS,
    liveliness=st.sampled_from((Liveliness.AUTOMATIC, Liveliness.MANUAL_BY_TOPIC)),
    lease_ns=DURATIONS,
)
# from the weakest to the strongest, as ROS 2 ranks them
RELIABILITY = (Reliability.BEST_EFFORT, Reliability.RELIABLE)
DURABILITY = (Durability.VOLATILE, Durability.TRANSIENT_LOCAL)
LIVELINESS = (Liveliness.AUTOMATIC, Liveliness.MANUAL_BY_TOPIC)


@settings(max_examples=50)
@given(PROFILES, PROFILES)
def test_an_offer_fits_when_no_policy_is_weaker_than_requested(offer, request_):
    def endless(duration_ns: int) -> int:
        return duration_ns or INFINITE_NS

    weaker = set()
    if RELIABILITY.index(offer.reliability) < RELIABILITY.index(request_.reliability):
        weaker.add("reliability")
    if DURABILITY.index(offer.durability) < DURABILITY.index(request_.durability):
        weaker.add("durability")
    if endless(offer.deadline_ns) > endless(request_.deadline_ns):
        weaker.add("deadline")
    if LIVELINESS.index(offer.liveliness) < LIVELINESS.index(request_.liveliness):
        weaker.add("liveliness")
    if endless(offer.lease_ns) > endless(request_.lease_ns):
        weaker.add("liveliness")
    assert {reason.partition(":")[0] for reason in incompatibilities(offer, request_)} == weaker
    assert incompatibilities(offer, offer) == ()


@pytest.mark.parametrize("offer", list(itertools.product(RELIABILITY, DURABILITY, LIVELINESS)))
@pytest.mark.parametrize("request_", list(itertools.product(RELIABILITY, DURABILITY, LIVELINESS)))
def test_both_ends_come_to_the_same_verdict(offer, request_):
    offered = QoSProfile(reliability=offer[0], durability=offer[1], liveliness=offer[2])
    requested = dataclasses.replace(offered, reliability=request_[0], durability=request_[1], liveliness=request_[2])
    publisher, subscription = endpoint("MP", node="p", qos=offered), endpoint("MS", node="s", eid=9, qos=requested)
    (there, _), (here, _) = Peers(publisher).add(subscription), Peers(subscription).add(publisher)
    verdicts = [found.mismatch and found.mismatch.policies for found in (there, here)]
    assert verdicts[0] == verdicts[1]
    assert bool(verdicts[0]) == bool(incompatibilities(offered, requested))
