"""The QoS with which a listener hears all publishers of a topic."""

from __future__ import annotations

from metaros.wire import Durability, QoSProfile, Reliability, qos_default, qos_sensor_data, qos_transient_local
from metaros.wire.matching import reading_qos


def kinds(*offered: QoSProfile) -> tuple[Reliability, Durability]:
    """What is asked for where these are offered."""
    qos = reading_qos(offered)
    return qos.reliability, qos.durability


def test_nobody_yet_is_the_default() -> None:
    assert kinds() == (Reliability.RELIABLE, Durability.VOLATILE)


def test_reliable_only_where_all_are() -> None:
    assert kinds(qos_default) == (Reliability.RELIABLE, Durability.VOLATILE)
    assert kinds(qos_default, qos_sensor_data) == (Reliability.BEST_EFFORT, Durability.VOLATILE)


def test_old_samples_only_where_all_keep_them() -> None:
    assert kinds(qos_transient_local)[1] is Durability.TRANSIENT_LOCAL
    assert kinds(qos_transient_local, qos_default)[1] is Durability.VOLATILE
