"""Sporadic heartbeats of transient_local publishers: what they say, and that no publisher's end waits for others."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from typing import Any

import pytest
import zenoh
import zenoh.ext

import metaros
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import qos_transient_local
from tests.support.processes.forked import ended, forked
from tests.support.waiting import wait_until


@contextmanager
def received(context: metaros.Context) -> Iterator[list[zenoh.Sample]]:
    """Every heartbeat that comes."""
    samples: list[zenoh.Sample] = []
    sink = zenoh.handlers.Callback(samples.append, indirect=False)
    with context.session.zenoh.declare_subscriber("**/@adv/pub/**", sink):
        yield samples


def numbers(samples: list[zenoh.Sample], topic: str) -> list[int]:
    """What was heard of one topic."""
    return [int.from_bytes(s.payload.to_bytes(), "little") for s in samples if f"/{topic}/" in f"/{s.key_expr}"]


def shape(sample: zenoh.Sample) -> tuple[object, ...]:
    """What a heartbeat is made of, but for the number and which publisher it is of."""
    zid, _, end = str(sample.key_expr).partition("/@adv/pub/")[2].split("/")
    made = sample.kind, sample.congestion_control, sample.priority, sample.encoding
    return zid, end, len(sample.payload), *map(str, made)


def test_a_heartbeat_is_the_one_that_zenoh_would_send(here, there):
    miss = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5)
    zenohs = zenoh.ext.declare_advanced_publisher(here.session.zenoh, "0/zenohs/x", sample_miss_detection=miss)
    with received(there) as samples, metaros.Node("a", context=here, enable_rosout=False) as node, zenohs:
        ours = node.create_publisher(String, "ours", qos_transient_local)
        for topic, put in (("zenohs", lambda: zenohs.put(b"x")), ("ours", lambda: ours.publish(String(data="x")))):
            next_number = count()

            def say(put: Any = put, next_number: Any = next_number) -> int:
                put()
                return next(next_number)

            wait_until(lambda topic=topic, say=say: say() >= 0 and numbers(samples, topic), every_s=0.05)
            last = [say() for _ in range(300)][-1]
            wait_until(lambda topic=topic, last=last: numbers(samples, topic)[-1] == last)
        assert len({shape(sample) for sample in samples}) == 1, samples


def test_a_publisher_that_was_closed_is_silent(here, there):
    with received(there) as samples, metaros.Node("a", context=here, enable_rosout=False) as node:
        closed, open_ = (node.create_publisher(String, topic, qos_transient_local) for topic in ("closed", "open"))
        wait_until(lambda: open_.publish(String(data="x")) or numbers(samples, "open"), every_s=0.05)
        closed.publish(String(data="x"))
        before = len(samples)
        closed.close()
        open_.publish(String(data="x"))
        wait_until(lambda: len(samples) > before)
    assert not numbers(samples, "closed")


IMPORTS = """
import ctypes, operator, os, time
from functools import partial
import zenoh
import metaros, metaros.node
from metaros.node.publisher import _declare
from metaros.wire import qos_transient_local
told, tell = os.pipe()
"""
SURVIVOR = """
zenoh.init_log_from_env_or("error")  # it complains of a task that does not end
context = metaros.Context(connect={router!r})
session, node = context.session.zenoh, metaros.Node("survivor", context=context)
publisher = _declare(session, "0/latched/x/y", qos_transient_local)
while len(list(session.info.peers_zid())) < 3 or len(context.graph.nodes()) < 4:
    time.sleep(0.02)
time.sleep(0.3)  # for those tokens to be told over the peers' own links, too, which cannot be seen
# All in C, so that Python's lock is never given away: the peers leave, Zenoh wants to tell of it, the publisher ends.
pause = partial(ctypes.PyDLL(None).usleep, 500_000)
list(map(operator.call, [partial(os.write, tell, b"123"), pause, publisher.undeclare]))
"""
PEER = """
context = metaros.Context(connect={router!r})
node = metaros.Node(f"peer{{number}}", context=context)
os.read(told, 1)
context.session.close()  # its tokens go with its link
"""


@pytest.mark.integration
def test_peers_that_leave_do_not_freeze_the_end_of_a_publisher(zenoh_router):
    programs = [SURVIVOR.format(router=zenoh_router), *[PEER.format(router=zenoh_router)] * 3]
    with forked(programs, imports=IMPORTS) as process:
        assert ended(process) == (dict.fromkeys(range(4), 0), "")
