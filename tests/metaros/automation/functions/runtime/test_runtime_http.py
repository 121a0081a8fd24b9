"""HTTP as workers speak it: whole requests out, whatever the pieces in which they come."""

from __future__ import annotations

import dataclasses

import pytest

from metaros.automation.functions.runtime.runtime_http import BadRequestError, Request, RequestReader, reply
from metaros.limits import LIMITS
from tests.support.tables import cases

LIMITED = dataclasses.replace(LIMITS, function_head_bytes=1000, function_response_bytes=100)
CHUNKED = b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n3;x=y\r\nabc\r\n2\r\nde\r\n0\r\nError-Type: E\r\n\r\n"
SIZED = b"POST /b HTTP/1.1\r\nHost: h\r\nContent-Length: 5\r\n\r\nhello"
PLAIN = b"GET /c HTTP/1.1\r\nHost: h\r\n\r\n"


class Reading:
    """What a reader told."""

    def __init__(self, *, taken: bool = False) -> None:
        self.pieces: list[bytes] = []
        self.requests: list[Request] = []
        self.went_on = 0
        self._taken = taken
        self.reader = RequestReader(begun=self.begun, done=self.requests.append, go_on=self.go_on, limits=LIMITED)

    def begun(self, request: Request) -> object:
        return self.pieces.append if self._taken else None

    def go_on(self) -> None:
        self.went_on += 1


def test_each_kind_of_request() -> None:
    reading = Reading()
    for data in (CHUNKED, SIZED, PLAIN):
        reading.reader.feed(data)
    chunked, sized, plain = reading.requests
    assert (chunked.target, chunked.body, chunked.trailers) == (b"/a", b"abcde", {b"error-type": b"E"})
    assert (sized.method, sized.target, sized.body, sized.headers[b"host"]) == (b"POST", b"/b", b"hello", b"h")
    assert (plain.method, plain.target, plain.body) == (b"GET", b"/c", b"")


@cases("size", [1, 2, 3, 7, 64])
def test_pieces_of_any_size(size: int) -> None:
    whole, split = Reading(), Reading()
    for data in (CHUNKED, SIZED, PLAIN) * 3:
        whole.reader.feed(data)
        for at in range(0, len(data), size):
            split.reader.feed(data[at : at + size])
    assert len(split.requests) == 9
    assert [dataclasses.astuple(r) for r in split.requests] == [dataclasses.astuple(r) for r in whole.requests]


def test_a_body_that_is_taken_piece_by_piece() -> None:
    reading = Reading(taken=True)
    reading.reader.feed(CHUNKED[:-20])
    assert reading.pieces == [b"abc", b"de"]
    assert reading.requests == []
    reading.reader.feed(CHUNKED[-20:])
    assert reading.requests[0].body == b""


@cases("size", [100, 101])
def test_a_body_at_its_limit_and_over(size: int) -> None:
    reading = Reading()
    reading.reader.feed(b"POST /a HTTP/1.1\r\nContent-Length: %d\r\n\r\n" % size + b"x" * size)
    reading.reader.feed(PLAIN)
    assert (len(reading.requests[0].body), reading.requests[0].cut) == ((100, False) if size == 100 else (0, True))
    assert reading.requests[1].target == b"/c", "the connection goes on"


def test_who_waits_for_leave_to_send_is_reported() -> None:
    reading = Reading()
    reading.reader.feed(b"POST /a HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 1\r\n\r\n")
    assert reading.went_on == 1


@cases(
    "data",
    [
        b"nonsense\r\n\r\n",
        b"GET /a HTTP/1.1 x\r\n\r\n",
        b"GET /a SPDY/1\r\n\r\n",
        b"GET /a HTTP/1.1\r\nno colon\r\n\r\n",
        b"POST /a HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
        b"POST /a HTTP/1.1\r\nContent-Length: 9999999999999999999\r\n\r\n",
        b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n",
        b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\n",
        b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n1\r\nabc\r\n",
        b"GET /a HTTP/1.1\r\nA: " + b"x" * 1000 + b"\r\n\r\n",
        b"x" * 1004,
    ],
)
@cases("size", [1, 10_000])
def test_what_is_no_request(data: bytes, size: int) -> None:
    reading = Reading()

    def read() -> None:
        for at in range(0, len(data), size):
            reading.reader.feed(data[at : at + size])

    with pytest.raises(BadRequestError):
        read()
    assert reading.requests == []


@cases("first", [CHUNKED, SIZED, PLAIN])
def test_a_request_behind_another_is_refused(first: bytes) -> None:
    """Thousands in one read would be answered at one go, while nothing else is done."""
    reading = Reading()
    with pytest.raises(BadRequestError, match="answered"):
        reading.reader.feed(first + PLAIN * 5000)
    assert len(reading.requests) == 1


def test_too_many_headers() -> None:
    reading = Reading()
    reading.reader.feed(b"GET /a HTTP/1.1\r\n" + b"a: b\r\n" * 128 + b"\r\n")
    with pytest.raises(BadRequestError, match="128 headers"):
        reading.reader.feed(b"GET /a HTTP/1.1\r\n" + b"a: b\r\n" * 129 + b"\r\n")


def test_too_many_trailers() -> None:
    reading = Reading()
    trailers = b"".join(b"T%d: x\r\n" % n for n in range(65))
    with pytest.raises(BadRequestError, match="64 trailers"):
        reading.reader.feed(b"POST /a HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n" + trailers + b"\r\n")


def test_an_answer() -> None:
    reported = reply(202, b"{}")
    assert reported == b"HTTP/1.1 202 Accepted\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}"
