"""Which profile satisfies which, as far as the profiles alone tell."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.qos.compatibility import QoSCompatibility, qos_check_compatible
from metaros.ros2.rclpy.qos.policies import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy
from metaros.ros2.rclpy.qos.profile import QoSPresetProfiles, QoSProfile
from metaros.ros2.rclpy.time.duration import Duration

OK, WARNING, ERROR = QoSCompatibility.OK, QoSCompatibility.WARNING, QoSCompatibility.ERROR
CASES: list[tuple[dict[str, Any], dict[str, Any], QoSCompatibility]] = [
    ({}, {}, OK),
    ({"reliability": ReliabilityPolicy.BEST_EFFORT}, {}, ERROR),
    ({}, {"reliability": ReliabilityPolicy.BEST_EFFORT}, OK),
    ({}, {"durability": DurabilityPolicy.TRANSIENT_LOCAL}, ERROR),
    ({"durability": DurabilityPolicy.TRANSIENT_LOCAL}, {}, OK),
    ({}, {"deadline": Duration(seconds=1)}, ERROR),
    ({"deadline": Duration(seconds=2)}, {"deadline": Duration(seconds=1)}, ERROR),
    ({"deadline": Duration(seconds=1)}, {"deadline": Duration(seconds=1)}, OK),
    ({"deadline": Duration(seconds=1)}, {}, OK),
    ({"liveliness_lease_duration": Duration(seconds=2)}, {"liveliness_lease_duration": Duration(seconds=1)}, ERROR),
    ({"liveliness": LivelinessPolicy.AUTOMATIC}, {"liveliness": LivelinessPolicy.MANUAL_BY_TOPIC}, ERROR),
    ({"liveliness": LivelinessPolicy.MANUAL_BY_TOPIC}, {"liveliness": LivelinessPolicy.AUTOMATIC}, OK),
    ({"reliability": ReliabilityPolicy.SYSTEM_DEFAULT}, {}, WARNING),
    ({"reliability": ReliabilityPolicy.BEST_EFFORT}, {"reliability": ReliabilityPolicy.UNKNOWN}, WARNING),
    ({"reliability": ReliabilityPolicy.BEST_AVAILABLE}, {}, OK),
    ({"durability": DurabilityPolicy.UNKNOWN}, {"durability": DurabilityPolicy.TRANSIENT_LOCAL}, WARNING),
    ({"durability": DurabilityPolicy.UNKNOWN}, {"durability": DurabilityPolicy.VOLATILE}, OK),
]


def test_profiles_are_compared_by_rule() -> None:
    wrong = []
    for offered, requested, expected in CASES:
        alike = {"liveliness": LivelinessPolicy.AUTOMATIC, "depth": 1}
        found, reason = qos_check_compatible(QoSProfile(**alike | offered), QoSProfile(**alike | requested))
        if found is not expected or bool(reason) is (expected is OK):
            wrong.append((offered, requested, found, reason))
    assert wrong == []


def test_presets_that_meet_every_day() -> None:
    sensor, reliable = QoSPresetProfiles.SENSOR_DATA.value, QoSProfile(depth=1, liveliness=LivelinessPolicy.AUTOMATIC)
    assert qos_check_compatible(sensor, reliable)[0] is ERROR
    assert "BEST_EFFORT is offered" in qos_check_compatible(sensor, reliable)[1]
    assert qos_check_compatible(QoSPresetProfiles.SYSTEM_DEFAULT.value, reliable)[0] is WARNING
