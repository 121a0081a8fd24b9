"""The gateway's reading of a QoS text, against the library's own."""

from __future__ import annotations

import pytest

from gateway.domain.qos import is_latched, offered_qos
from metaros.record.qos_yaml import read_qos
from metaros.wire import Durability, History, Liveliness, QoSProfile, Reliability

PROFILES = [
    QoSProfile(),
    QoSProfile(reliability=Reliability.BEST_EFFORT, depth=5),
    QoSProfile(durability=Durability.TRANSIENT_LOCAL, depth=1),
    QoSProfile(history=History.KEEP_ALL),
    QoSProfile(deadline_ns=1_500_000_000, lifespan_ns=20, lease_ns=3_000_000_000),
    QoSProfile(liveliness=Liveliness.MANUAL_BY_TOPIC),
]


@pytest.mark.parametrize("profile", PROFILES)
def test_text_in_a_recording_says_what_the_token_says(profile: QoSProfile) -> None:
    text = profile.encode()
    assert read_qos(offered_qos(text)) == [profile]
    assert is_latched(text) == (profile.durability is Durability.TRANSIENT_LOCAL)


def test_unknown_and_broken_texts_are_nothing_special() -> None:
    assert offered_qos("") == ""
    for text in ("", ":", "x:y:z", "9:9:9,x:a,b:c:,,", "1:2"):
        assert not is_latched(text)
        assert read_qos(offered_qos(text)) in ([], [QoSProfile(depth=42)])
