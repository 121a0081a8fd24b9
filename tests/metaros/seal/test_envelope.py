"""The envelope: what is bound, what is refused, and that bytes from anywhere raise nothing but our own errors."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.clock import ManualClock
from metaros.errors import SealError, SealFormatError, SealKeyError
from metaros.seal import OVERHEAD_BYTES, Keyring, Opener, Origin, Sealer, SealKey, parse_head
from tests.support.tables import cases, refusal

CLOCK = ManualClock()
RING = Keyring((SealKey.make(CLOCK),))
ODOM = Origin(robot="r1", topic="/odom", type_name="nav_msgs/msg/Odometry", type_hash="RIHS01_aa")
SEALED = Sealer(RING, CLOCK).seal(b"marker", ODOM, stream=7, epoch=3, seq=41)


def test_what_was_sealed_opens_with_the_key_and_is_not_in_the_bytes() -> None:
    payload, head = Opener(RING).open(SEALED, ODOM, seq=41)
    assert payload == b"marker"
    assert (head.stream, head.epoch, head.seq, head.key_id) == (7, 3, 41, RING.current.key_id)
    assert len(SEALED) == len(b"marker") + OVERHEAD_BYTES
    assert b"marker" not in SEALED


@cases(
    "changed",
    [
        {"robot": "r2"},
        {"topic": "/map"},
        {"type_name": "nav_msgs/msg/Path"},
        {"type_hash": "RIHS01_bb"},
        {"robot": "r1/odom", "topic": ""},
    ],
)
def test_a_payload_of_another_robot_topic_or_type_is_refused(changed: dict[str, str]) -> None:
    with pytest.raises(SealError, match="not of this robot, topic and type"):
        Opener(RING).open(SEALED, replace(ODOM, **changed))


def test_a_payload_under_another_number_is_refused() -> None:
    with pytest.raises(SealError, match="sealed as number 41, found as 42"):
        Opener(RING).open(SEALED, ODOM, seq=42)


def test_texts_cannot_be_shifted_from_one_field_to_the_next() -> None:
    one = Origin(robot="a", topic="bc", type_name="t", type_hash="h")
    sealed = Sealer(RING, CLOCK).seal(b"x", one, stream=1, epoch=1, seq=1)
    with pytest.raises(SealError):
        Opener(RING).open(sealed, replace(one, robot="ab", topic="c"))


def test_each_bit_flipped_anywhere_is_refused() -> None:
    def opens(bit: int) -> bool:
        changed = bytearray(SEALED)
        changed[bit // 8] ^= 1 << bit % 8
        return not refusal(SealError, Opener(RING).open, bytes(changed), ODOM)

    assert [bit for bit in range(len(SEALED) * 8) if opens(bit)] == []


def test_a_key_that_the_ring_lacks_is_named() -> None:
    with pytest.raises(SealKeyError, match=RING.current.key_id.hex()):
        Opener(Keyring((SealKey.make(CLOCK),))).open(SEALED, ODOM)


def test_a_key_of_that_id_with_another_secret_is_refused() -> None:
    wrong = replace(RING.current, secret=bytes(32))
    with pytest.raises(SealError, match="changed on its way"):
        Opener(Keyring((wrong,))).open(SEALED, ODOM)


@settings(max_examples=40)
@given(st.binary(max_size=OVERHEAD_BYTES - 1))
def test_too_few_bytes_are_no_sealed_payload(data: bytes) -> None:
    with pytest.raises(SealFormatError):
        parse_head(data)


@settings(max_examples=200, deadline=None)
@given(
    st.one_of(
        st.binary(max_size=200), st.builds(lambda rest: b"\x01" + RING.current.key_id + rest, st.binary(max_size=200))
    )
)
def test_any_bytes_are_refused_by_our_own_errors_only(data: bytes) -> None:
    with pytest.raises(SealError):
        Opener(RING).open(data, ODOM)


@settings(max_examples=40)
@given(st.binary(max_size=4096), st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1), st.integers(0, 2**64 - 1))
def test_any_payload_and_numbers_come_back(payload: bytes, stream: int, epoch: int, seq: int) -> None:
    sealed = Sealer(RING, CLOCK).seal(payload, ODOM, stream=stream, epoch=epoch, seq=seq)
    assert Opener(RING).open(sealed, ODOM, seq=seq).payload == payload
