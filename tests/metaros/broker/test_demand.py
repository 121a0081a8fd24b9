"""Prefixes that ZeroMQ subscribers ask for, and the topics these mean."""

from __future__ import annotations

from metaros.broker.demand import Demand
from metaros.limits import LIMITS


def test_prefixes_mean_topics() -> None:
    demand = Demand()
    for prefix in (b"/chat", b"/exact ", b"bare", b'/deep {"data"'):
        demand.subscribe(prefix)
    assert demand.spellings("/chatter") == (b"/chatter",)
    assert demand.spellings("/exact") == (b"/exact",)
    assert demand.spellings("/exactly") == ()
    assert demand.spellings("/bare") == (b"bare",)
    assert demand.spellings("/deep") == (b"/deep",)
    assert demand.spellings("/deeper") == ()
    assert demand.spellings("/else") == ()


def test_everything_is_wanted_once() -> None:
    demand = Demand()
    demand.subscribe(b"")
    assert demand.spellings("/chatter") == (b"/chatter",)
    demand.subscribe(b"chatter")
    assert demand.spellings("/chatter") == (b"/chatter", b"chatter")


def test_a_topic_lingers_and_then_is_left() -> None:
    demand = Demand(linger_s=2.0)
    demand.subscribe(b"/a")
    demand.unsubscribe(b"/a", now_s=10.0)
    assert demand.spellings("/a") == ()
    assert demand.wanted("/a")
    demand.sweep(now_s=11.0)
    assert demand.wanted("/a")
    version = demand.version
    demand.sweep(now_s=12.0)
    assert not demand.wanted("/a")
    assert demand.version > version


def test_who_comes_back_in_time_is_there() -> None:
    demand = Demand(linger_s=2.0)
    demand.subscribe(b"/a")
    demand.unsubscribe(b"/a", now_s=10.0)
    demand.subscribe(b"/a")
    demand.sweep(now_s=20.0)
    assert demand.spellings("/a") == (b"/a",)


def test_unknown_ends_change_nothing_and_there_is_a_limit() -> None:
    demand = Demand()
    demand.unsubscribe(b"/never", now_s=0.0)
    assert not demand.wanted("/never")
    for number in range(LIMITS.broker_prefixes + 2):
        demand.subscribe(b"%d" % number)
    assert (len(demand.prefixes), demand.refused) == (LIMITS.broker_prefixes, 2)
