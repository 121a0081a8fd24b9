"""QoS profiles: how they are made, refused, compared and shown."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.ros2.rclpy.qos import profile
from metaros.ros2.rclpy.qos.policies import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSPolicyKind,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from metaros.ros2.rclpy.qos.profile import InvalidQoSProfileException, QoSPresetProfiles, QoSProfile
from metaros.ros2.rclpy.time.duration import Duration


def test_a_depth_is_enough() -> None:
    qos = QoSProfile(depth=3)
    assert (qos.history, qos.depth) == (HistoryPolicy.KEEP_LAST, 3)
    assert (qos.reliability, qos.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    assert {qos.deadline, qos.lifespan, qos.liveliness_lease_duration} == {Duration()}
    assert not qos.avoid_ros_namespace_conventions


def test_a_profile_without_depth_is_refused() -> None:
    for arguments in ({}, {"history": HistoryPolicy.KEEP_LAST}, {"reliability": ReliabilityPolicy.RELIABLE}):
        with pytest.raises(InvalidQoSProfileException, match="Invalid QoSProfile"):
            QoSProfile(**arguments)
    assert QoSProfile(history=HistoryPolicy.KEEP_ALL).depth == 10


def test_values_of_other_types_are_refused() -> None:
    wrong: list[dict[str, Any]] = [
        {"depth": "1"},
        {"depth": 1, "deadline": 1.0},
        {"depth": 1, "reliability": "reliable"},
        {"depth": 1, "avoid_ros_namespace_conventions": 1},
        {"depth": 1, "dept": 2},
    ]
    for arguments in wrong:
        with pytest.raises(AssertionError):
            QoSProfile(**arguments)
    with pytest.raises(ValueError):
        QoSProfile(depth=1, reliability=17)


def test_numbers_stand_for_policies() -> None:
    qos = QoSProfile(history=1, depth=1, reliability=2, durability=1, liveliness=3)
    assert (qos.reliability, qos.durability) == (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.TRANSIENT_LOCAL)
    assert qos.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC


def test_a_depth_of_zero_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="zero with KEEP_LAST"):
        QoSProfile(depth=0)
    assert profile.qos_profile_system_default.depth == 0  # with the system's history it is right


def test_profiles_are_compared_by_all_fields() -> None:
    qos = QoSProfile(depth=1)
    assert qos == QoSProfile(depth=1, history=HistoryPolicy.KEEP_LAST)
    assert qos != QoSProfile(depth=2)
    assert qos != QoSProfile(depth=1, deadline=Duration(seconds=2))
    assert QoSProfile(depth=1, deadline=Duration(seconds=2)) == QoSProfile(depth=1, deadline=Duration(nanoseconds=2e9))
    assert qos != 1
    assert str(qos).startswith("QoSProfile(history=1, depth=1, ")
    every = QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        depth=12,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        lifespan=Duration(seconds=5),
        deadline=Duration(nanoseconds=1e6),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(nanoseconds=12),
        avoid_ros_namespace_conventions=True,
    )
    assert QoSProfile(**every.get_c_qos_profile().to_dict()) == every


def test_policies_have_short_names() -> None:
    assert HistoryPolicy.short_keys() == ["system_default", "keep_last", "keep_all", "unknown"]
    assert HistoryPolicy.get_from_short_key("KEEP_all") == HistoryPolicy.KEEP_ALL.value
    assert ReliabilityPolicy.BEST_AVAILABLE.short_key == "best_available"
    assert profile.QoSReliabilityPolicy is ReliabilityPolicy
    assert qos_policy_name_from_kind(16) == QoSPolicyKind.RELIABILITY.name


def test_old_names_of_values_warn() -> None:
    with pytest.warns(UserWarning, match=r"deprecated\. Use HistoryPolicy\.KEEP_LAST"):
        old: Any = HistoryPolicy.RMW_QOS_POLICY_HISTORY_KEEP_LAST  # type: ignore[attr-defined]
    assert old is HistoryPolicy.KEEP_LAST


def test_presets_are_those_of_ros() -> None:
    found = {
        name: (qos.history.name, qos.depth, qos.reliability.name, qos.durability.name)
        for name, qos in ((preset, getattr(profile, f"qos_profile_{preset}")) for preset in _PRESETS)
    }
    assert found == _PRESETS
    assert QoSPresetProfiles.SENSOR_DATA.value == profile.qos_profile_sensor_data
    assert QoSPresetProfiles.get_from_short_key("Best_Available") == profile.qos_profile_best_available
    assert set(QoSPresetProfiles.short_keys()) == set(_PRESETS) - {"rosout_default"}


_PRESETS = {
    "default": ("KEEP_LAST", 10, "RELIABLE", "VOLATILE"),
    "unknown": ("UNKNOWN", 0, "UNKNOWN", "UNKNOWN"),
    "system_default": ("SYSTEM_DEFAULT", 0, "SYSTEM_DEFAULT", "SYSTEM_DEFAULT"),
    "sensor_data": ("KEEP_LAST", 5, "BEST_EFFORT", "VOLATILE"),
    "services_default": ("KEEP_LAST", 10, "RELIABLE", "VOLATILE"),
    "parameters": ("KEEP_LAST", 1000, "RELIABLE", "VOLATILE"),
    "parameter_events": ("KEEP_LAST", 1000, "RELIABLE", "VOLATILE"),
    "best_available": ("KEEP_LAST", 10, "BEST_AVAILABLE", "BEST_AVAILABLE"),
    "action_status_default": ("KEEP_LAST", 1, "RELIABLE", "TRANSIENT_LOCAL"),
    "rosout_default": ("KEEP_LAST", 1000, "RELIABLE", "TRANSIENT_LOCAL"),
}
