"""rclpy's profiles on this library's wire, and back."""

from __future__ import annotations

from metaros.ros2.rclpy.qos import profile
from metaros.ros2.rclpy.qos.conversion import from_native, to_native
from metaros.ros2.rclpy.qos.policies import HistoryPolicy, LivelinessPolicy, ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import QoSProfile
from metaros.ros2.rclpy.time.duration import Duration
from metaros.wire import QoSProfile as WireProfile
from metaros.wire.qos import INFINITE_NS, Durability, Liveliness, Reliability


def test_profiles_are_on_the_wire_as_ros_has_them() -> None:
    expected = {  # the texts of rmw_zenoh_cpp
        "default": "::,10:,:,:,,",
        "system_default": "::,:,:,:,,",
        "sensor_data": "2::,5:,:,:,,",
        "services_default": "::,10:,:,:,,",
        "parameters": "::,1000:,:,:,,",
        "action_status_default": ":1:,1:,:,:,,",
        "rosout_default": ":1:,1000:,:10,0:,,",
        "unknown": "::,:,:,:,,",
    }
    assert {name: to_native(getattr(profile, f"qos_profile_{name}")).encode() for name in expected} == expected


def test_all_fields_come_back() -> None:
    qos = QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        depth=12,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        lifespan=Duration(seconds=4),
        deadline=Duration(nanoseconds=1e6),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(nanoseconds=12),
    )
    assert from_native(to_native(qos)) == qos
    shown = from_native(WireProfile(liveliness=Liveliness.MANUAL_BY_NODE))
    assert (shown.liveliness, str(shown.deadline)) == (LivelinessPolicy.UNKNOWN, "Infinite")


def test_the_best_available_is_what_matches_all_that_are_there() -> None:
    best = profile.qos_profile_best_available
    reliable = WireProfile(durability=Durability.TRANSIENT_LOCAL, deadline_ns=10, liveliness=Liveliness.MANUAL_BY_TOPIC)
    loose = WireProfile(reliability=Reliability.BEST_EFFORT, deadline_ns=30)

    alone = to_native(best)
    assert (alone.reliability, alone.durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL)
    assert (alone.deadline_ns, alone.lease_ns, alone.liveliness) == (INFINITE_NS, INFINITE_NS, Liveliness.AUTOMATIC)

    strict = to_native(best, peers=[reliable])
    assert (strict.reliability, strict.durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL)
    assert (strict.deadline_ns, strict.liveliness) == (10, Liveliness.MANUAL_BY_TOPIC)

    mixed = to_native(best, peers=[reliable, loose])
    assert (mixed.reliability, mixed.durability) == (Reliability.BEST_EFFORT, Durability.VOLATILE)
    assert (mixed.deadline_ns, mixed.liveliness) == (30, Liveliness.AUTOMATIC)

    offer = to_native(best, peers=[reliable, loose], publishes=True)
    assert (offer.reliability, offer.durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL)
    assert (offer.deadline_ns, offer.liveliness) == (10, Liveliness.MANUAL_BY_TOPIC)
