"""Binary messages against the protocol's golden vectors, and against anything at all."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gateway.api.foxglove.binary import (
    ClientData,
    PlaybackControl,
    ServiceCall,
    asset_failure,
    asset_response,
    message_head,
    playback_state,
    read_binary,
    service_response,
    time_message,
)
from gateway.errors import InvalidRequestError
from tests.support.tables import refusal


def raw(text: str) -> bytes:
    return bytes.fromhex(text.replace(" ", ""))


def test_what_the_server_sends_is_the_golden_bytes() -> None:
    assert message_head(30, 1234) + b"{" == raw("01 1e000000 d204000000000000 7b")
    assert time_message(1_234_567_890) == raw("02 d202964900000000")
    assert asset_response(10, b"data") == raw("04 0a000000 00 00000000 64617461")
    assert asset_failure(10, "no") == raw("04 0a000000 01 02000000 6e6f")
    assert playback_state(0, 12345, 1.0, did_seek=True) == raw("05 00 3930000000000000 0000803f 01 00000000")
    assert service_response(10, 12, "json", b"{}") == raw("03 0a000000 0c000000 04000000 6a736f6e 7b7d")


def test_what_a_client_sends_is_read_from_the_golden_bytes() -> None:
    call = read_binary(raw("02 0a000000 0c000000 04000000 6a736f6e 7b7d"))
    assert call == ServiceCall(10, 12, "json", b"{}")
    seek = read_binary(raw("03 00 0000803f 01 15cd5b0700000000 07000000 736f6d652d6964"))
    assert seek == PlaybackControl(play=True, speed=1.0, seek_ns=123_456_789, request_id="some-id")
    pause = read_binary(raw("03 01 00000040 00 0000000000000000 00000000"))
    assert pause == PlaybackControl(play=False, speed=2.0, seek_ns=None, request_id="")
    assert read_binary(raw("01 05000000 0102")) == ClientData(5, b"\x01\x02")


def test_a_time_that_no_clock_shows_is_one_all_the_same() -> None:
    assert message_head(1, -5) == raw("01 01000000 0000000000000000")
    assert time_message(2**70) == raw("02 ffffffffffffffff")


NONE = (
    "",
    "00",
    "04",
    "01 0000",
    "02 0a000000 0c000000 05000000 6a736f6e",
    "03 02 0000803f 00 0000000000000000 00000000",
)


def test_what_is_none_is_refused() -> None:
    assert [said for said in NONE if not refusal(InvalidRequestError, read_binary, raw(said))] == []


@given(st.binary(max_size=64))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        read_binary(data)
    except InvalidRequestError:
        return
    assert data[0] in (1, 2, 3)
