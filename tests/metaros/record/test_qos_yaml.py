"""QoS as rosbag2 writes it: rosbags reads ours, we read all of its releases."""

from __future__ import annotations

from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2.metadata import dump_qos_v8, parse_qos

from metaros.record.qos_yaml import offered_qos, read_qos
from metaros.wire import QoSProfile, qos_rosout, qos_sensor_data, qos_transient_local

PROFILES = [qos_sensor_data, qos_transient_local, qos_rosout, QoSProfile(deadline_ns=1_500_000_000)]


def test_round_trip() -> None:
    assert read_qos(offered_qos(PROFILES)) == PROFILES


def test_rosbags_reads_it_and_we_read_the_old_form() -> None:
    parsed = parse_qos(offered_qos(PROFILES))
    assert parsed[0].reliability is QosReliability.BEST_EFFORT
    assert parsed[1].durability is QosDurability.TRANSIENT_LOCAL
    assert read_qos(dump_qos_v8(parsed)) == PROFILES


def test_what_cannot_be_read_is_left_out() -> None:
    assert read_qos("") == []
    assert read_qos("{") == []
    assert read_qos("- history: strange\n- 3\n") == []
    assert read_qos("7") == []
