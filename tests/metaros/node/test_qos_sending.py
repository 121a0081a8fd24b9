"""How a publisher sends: priority, congestion policy and reliability, as a raw Zenoh subscriber sees them."""

from __future__ import annotations

import queue

import pytest
import zenoh

import metaros
from metaros.interfaces.std_msgs.msg import String
from metaros.wire import Congestion, Durability, History, Priority, QoSProfile, Reliability, qos_default

DROP, BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK


@pytest.mark.parametrize(
    ("profile", "priority", "congestion"),
    [
        (qos_default, "DATA", DROP),
        (metaros.qos_sensor_data, "DATA_LOW", DROP),
        (metaros.qos_command, "REAL_TIME", BLOCK),
        (metaros.qos_reliable_all, "DATA", BLOCK),
        (QoSProfile(history=History.KEEP_ALL, reliability=Reliability.BEST_EFFORT), "DATA", DROP),
        (QoSProfile(history=History.KEEP_ALL, congestion=Congestion.DROP), "DATA", DROP),
        (QoSProfile(priority=Priority.BACKGROUND), "BACKGROUND", DROP),
        (QoSProfile(durability=Durability.TRANSIENT_LOCAL, priority=Priority.DATA_HIGH), "DATA_HIGH", DROP),
    ],
)
def test_priority_and_congestion_policy_are_zenohs(here, there, profile, priority, congestion):
    samples: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    with metaros.Node("a", context=here, enable_rosout=False) as node:
        publisher = node.create_publisher(String, "chatter", profile)
        subscriber = there.session.zenoh.declare_subscriber(publisher.key, samples.put)
        with subscriber:
            for _ in range(600):  # the subscriber's declaration is on its way to us
                publisher.publish(String(data="x"))
                try:
                    sample = samples.get(timeout=0.1)
                except queue.Empty:
                    continue
                break
        assert (sample.priority, sample.congestion_control) == (getattr(zenoh.Priority, priority), congestion)


def test_what_only_the_sender_cares_for_is_neither_on_the_wire_nor_compared():
    assert metaros.qos_command.encode() == QoSProfile(depth=1).encode() == "::,1:,:,:,,"
    assert metaros.qos_command == QoSProfile(depth=1)
    assert metaros.qos_command.resolved().priority is Priority.REAL_TIME
