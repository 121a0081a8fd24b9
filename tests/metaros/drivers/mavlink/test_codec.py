"""Frames among garbage, and signatures."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from metaros.drivers.mavlink.codec import MAX_FRAME, Codec, signing_key
from metaros.errors import ConfigError

KEY, OTHER_KEY = bytes(range(32)), bytes(range(1, 33))
WALL_NS = 1_800_000_000 * 10**9


class Counts(Counter[str]):
    """A DriverContext's count."""

    def __call__(self, name: str, by: int = 1) -> None:
        self[name] += by


def codec(counts: Counts, key: bytes = b"", *, system: int = 1, wall_ns: int = WALL_NS) -> Codec:
    return Codec(system=system, component=1, count=counts, key=key, wall_ns=wall_ns)


def heartbeat(mode: int = 0) -> Any:
    return dialect.MAVLink_heartbeat_message(2, 3, 0, mode, 4, 3)


def modes(messages: Any) -> list[int]:
    return [message.custom_mode for message in messages if message.get_type() == "HEARTBEAT"]


def test_frames_in_any_pieces() -> None:
    sender, ears = codec(Counts()), codec(Counts())
    stream = b"".join(sender.pack(heartbeat(n)) for n in range(300))
    received = [m for i in range(0, len(stream), 7) for m in ears.feed(stream[i : i + 7])]
    assert modes(received) == list(range(300))


def test_mavlink_1_is_received_too() -> None:
    old = dialect.MAVLink(None, srcSystem=9, srcComponent=1)
    (message,) = codec(Counts()).feed(bytes(heartbeat(5).pack(old, force_mavlink1=True)))
    assert (message.custom_mode, message.get_srcSystem()) == (5, 9)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.binary(max_size=600), max_size=6))
def test_a_frame_after_any_garbage_is_received(pieces: list[bytes]) -> None:
    counts = Counts()
    ears, sender = codec(counts), codec(Counts())
    for piece in pieces:
        list(ears.feed(piece))
        assert len(ears._buffer) <= MAX_FRAME
    # A begun frame in the garbage waits for its length; the frames that fill it are found again one byte later.
    stream = b"".join(sender.pack(heartbeat(n)) for n in range(1, 40))
    assert 39 in modes(ears.feed(stream))


def test_a_false_beginning_hides_nothing_behind_it() -> None:
    counts = Counts()
    frames = b"".join(codec(Counts()).pack(heartbeat(n)) for n in (1, 2, 3))
    false = b"\xfd\x09\x00\x00\x00\x01\x01\x00\x00\x00"  # the head of a heartbeat whose rest was lost
    assert modes(codec(counts).feed(false + frames)) == [1, 2, 3]
    assert counts["bad_frames"] >= 1


def test_a_changed_bit_is_noticed() -> None:
    frame = bytearray(codec(Counts()).pack(heartbeat(1)))
    for bit in range(8, len(frame) * 8):
        wrong = bytearray(frame)
        wrong[bit // 8] ^= 1 << bit % 8
        received = [m for m in codec(Counts()).feed(bytes(wrong) + bytes(300)) if m.get_type() == "HEARTBEAT"]
        assert received == []


def test_signed_both_ways() -> None:
    a, b = codec(Counts(), KEY, system=1), codec(Counts(), KEY, system=255)
    assert modes(b.feed(a.pack(heartbeat(1)))) == [1]
    assert modes(a.feed(b.pack(heartbeat(2)))) == [2]


def test_unsigned_wrongly_signed_and_replayed_are_not_believed() -> None:
    counts = Counts()
    ears, sender = codec(counts, KEY), codec(Counts(), KEY)
    first = sender.pack(heartbeat(1))
    assert modes(ears.feed(first)) == [1]
    assert modes(ears.feed(first)) == []
    assert modes(ears.feed(codec(Counts()).pack(heartbeat(2)))) == []
    assert modes(ears.feed(codec(Counts(), OTHER_KEY).pack(heartbeat(3)))) == []
    assert counts["bad_frames"] >= 3


def test_a_forger_with_a_clock_ahead_does_not_shut_out_the_true_sender() -> None:
    ears, sender = codec(Counts(), KEY), codec(Counts(), KEY)
    forger = codec(Counts(), OTHER_KEY, wall_ns=WALL_NS + 10**18)
    assert modes(ears.feed(forger.pack(heartbeat(1)))) == []
    received = [mode for n in range(2, 40) for mode in modes(ears.feed(sender.pack(heartbeat(n))))]
    assert received[:20] == list(range(2, 22))  # what is left of the forged frame may look like the start of a long one


@pytest.mark.parametrize("text", ["", "ab", "zz" * 32, "00" * 33])
def test_keys_that_are_none(text: str) -> None:
    with pytest.raises(ConfigError, match=r"a\.key: a signing key is 64 hexadecimal digits"):
        signing_key(text, "a.key")
    assert signing_key(KEY.hex() + "\n", "a.key") == KEY
