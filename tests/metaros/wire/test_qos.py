"""QoS profiles: their text, and which offers satisfy which requests."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import metaros
from metaros import wire
from metaros.errors import FieldError, TokenError
from metaros.wire import qos
from metaros.wire.qos import INFINITE_NS, Durability, History, Liveliness, QoSProfile, Reliability, incompatibilities
from tests.support.tables import cases

PROFILES = st.builds(
    QoSProfile,
    reliability=st.sampled_from(Reliability),
    durability=st.sampled_from(Durability),
    history=st.sampled_from(History),
    depth=st.integers(0, 2**31 - 1),
    deadline_ns=st.integers(0, INFINITE_NS),
    lifespan_ns=st.integers(0, INFINITE_NS),
    liveliness=st.sampled_from(Liveliness),
    lease_ns=st.integers(0, INFINITE_NS),
)


@pytest.mark.parametrize(
    ("profile", "text"),
    [
        (qos.qos_default, "::,10:,:,:,,"),
        (QoSProfile(depth=42), "::,:,:,:,,"),
        (QoSProfile(depth=0), "::,:,:,:,,"),
        (qos.qos_sensor_data, "2::,5:,:,:,,"),
        (qos.qos_transient_local, ":1:,1:,:,:,,"),
        (qos.qos_reliable_all, "::2,10:,:,:,,"),
        (qos.qos_services, "::,10:,:,:,,"),
        (qos.qos_parameters, "::,1000:,:,:,,"),
        (qos.qos_rosout, ":1:,1000:,:10,0:,,"),
        (
            QoSProfile(
                deadline_ns=500_000_000,
                lifespan_ns=2_000_000_000,
                liveliness=Liveliness.MANUAL_BY_TOPIC,
                lease_ns=1_000_000_005,
            ),
            "::,10:0,500000000:2,0:3,1,5",
        ),
        (
            QoSProfile(
                reliability=Reliability.SYSTEM_DEFAULT,
                durability=Durability.SYSTEM_DEFAULT,
                history=History.SYSTEM_DEFAULT,
                depth=0,
                liveliness=Liveliness.SYSTEM_DEFAULT,
                deadline_ns=0,
            ),
            "::,:,:,:,,",
        ),
    ],
)
def test_profiles_have_the_text_that_rmw_zenoh_writes(profile, text):
    assert profile.encode() == text
    assert QoSProfile.decode(text) == profile.resolved()


@settings(max_examples=50)
@given(PROFILES)
def test_a_text_gives_its_profile_back(profile):
    assert QoSProfile.decode(profile.encode()) == profile.resolved()


@settings(max_examples=50)
@given(st.one_of(st.text(alphabet="0123456789:,", max_size=40), st.text(max_size=40)))
def test_any_text_is_a_profile_or_a_token_error(text):
    try:
        profile = QoSProfile.decode(text)
    except TokenError:
        return
    assert QoSProfile.decode(profile.encode()) == profile.resolved()


@cases(
    ("text", "said"),
    [
        ("::,:,:,", "has 5 parts: 6 are required"),
        ("::,:,:,:,", "lacks the history depth or the liveliness lease"),
        ("::,2147483648:,:,:,,", "QoS depth 2147483648 is out of range"),
        ("::,x:,:,:,,", "'x' in a QoS string is no number"),
        ("9::,:,:,:,,", "9 is no reliability of a QoS string"),
        (":9:,:,:,:,,", "9 is no durability of a QoS string"),
        ("::9,:,:,:,,", "9 is no history of a QoS string"),
        ("::,:,:,:9,,", "9 is no liveliness of a QoS string"),
    ],
)
def test_a_text_that_is_none_says_where(text, said):
    with pytest.raises(TokenError, match=said):
        QoSProfile.decode(text)


def test_the_largest_depth_is_read():
    assert QoSProfile.decode("::,2147483647:,:,:,,").depth == 2147483647


def test_bounds_are_named():
    with pytest.raises(FieldError, match="depth"):
        QoSProfile(depth=-1)
    with pytest.raises(FieldError, match="deadline_ns"):
        QoSProfile(deadline_ns=-1)


@pytest.mark.parametrize(
    ("offer", "request_", "word"),
    [
        ({"reliability": Reliability.BEST_EFFORT}, {}, "reliability"),
        ({}, {"durability": Durability.TRANSIENT_LOCAL}, "durability"),
        ({"deadline_ns": 2}, {"deadline_ns": 1}, "deadline"),
        ({}, {"liveliness": Liveliness.MANUAL_BY_TOPIC}, "liveliness"),
        ({"lease_ns": 2}, {"lease_ns": 1}, "lease"),
    ],
)
def test_a_weaker_offer_does_not_satisfy_a_stronger_request(offer, request_, word):
    weak, strong = QoSProfile(**offer), QoSProfile(**request_)
    assert word in " ".join(incompatibilities(weak, strong))
    assert incompatibilities(strong, weak) == ()


def test_names_of_rclpy_are_the_same_classes_with_all_of_its_members() -> None:
    rclpy = {
        "Reliability": {"SYSTEM_DEFAULT": 0, "RELIABLE": 1, "BEST_EFFORT": 2, "UNKNOWN": 3, "BEST_AVAILABLE": 4},
        "Durability": {"SYSTEM_DEFAULT": 0, "TRANSIENT_LOCAL": 1, "VOLATILE": 2, "UNKNOWN": 3, "BEST_AVAILABLE": 4},
        "History": {"SYSTEM_DEFAULT": 0, "KEEP_LAST": 1, "KEEP_ALL": 2, "UNKNOWN": 3},
        "Liveliness": {"SYSTEM_DEFAULT": 0, "AUTOMATIC": 1, "MANUAL_BY_TOPIC": 3, "UNKNOWN": 4, "BEST_AVAILABLE": 5},
    }
    for name, members in rclpy.items():
        kind = getattr(qos, name)
        for module in (qos, wire, metaros):
            for alias in (f"{name}Policy", f"QoS{name}Policy"):
                assert getattr(module, alias) is kind
                assert alias in module.__all__
        assert members.items() <= {member.name: member.value for member in kind}.items()
