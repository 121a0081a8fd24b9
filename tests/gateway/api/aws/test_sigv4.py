"""Signatures made by botocore are checked; whatever is changed afterwards is seen."""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime
from typing import Any

import pytest
from botocore.auth import SigV4Auth, SigV4QueryAuth
from botocore.awsrequest import AWSRequest
from botocore.credentials import Credentials

from gateway.api.aws.errors import (
    SignatureExpiredError,
    SignatureIncompleteError,
    SignatureWrongError,
    UnknownAccessKeyError,
    UnsignedError,
)
from gateway.api.aws.sigv4 import check_time, read_signature, verify
from metaros.errors import MetarosError

HOST, BODY, SECRET = "gateway.example:8080", b'{"a": 1}', "secret"
PATHS = (
    "/lambda/2015-03-31/functions/",
    "/lambda/2015-03-31/functions/arn%3Aaws%3Alambda%3Alocal%3A000000000000%3Afunction%3Aname/invocations",
    "/lambda/2015-03-31/functions/name/invocations?Qualifier=%24LATEST&b=&a=1",
    "/lambda//2015-03-31/./functions/x/../a%20b~c/?a=2&a=1&B&=x&c=%2F",
)

Headers = list[tuple[bytes, bytes]]


def signed(path: str = PATHS[0], body: bytes = BODY, *, token: str | None = None, **headers: str) -> Headers:
    """The headers of a request as botocore signs it."""
    request = AWSRequest("POST", f"http://{HOST}{path}", {"Host": HOST, **headers}, body)
    SigV4Auth(Credentials("0123456789abcdef", SECRET, token), "lambda", "local").add_auth(request)
    return [(name.lower().encode(), value.encode()) for name, value in request.headers.items()]


def check(headers: Headers, path: str = PATHS[0], body: bytes = BODY, *, secret: str = SECRET) -> None:
    """Raise what is wrong."""
    raw, _, query = path.partition("?")
    sha256 = hashlib.sha256(body).hexdigest()
    verify(read_signature(headers), secret, method="POST", path=raw, query=query, sha256=sha256)


@pytest.mark.parametrize("path", PATHS)
def test_what_botocore_signs_is_good(path: str) -> None:
    headers = signed(path, **{"X-Amz-Invocation-Type": "Event", "Content-Type": "a/b", "X-Amz-Y": " a  b "})
    check([*headers, (b"user-agent", b"x"), (b"accept-encoding", b"identity")], path)
    found = read_signature(headers)
    assert (found.key_id, found.region) == ("0123456789abcdef", "local")


def altered(headers: Headers, name: bytes, value: bytes) -> Headers:
    """The headers with another value of one."""
    return [(key, value if key == name else old) for key, old in headers]


def test_whatever_is_changed_is_seen() -> None:
    headers = signed(**{"X-Amz-Invocation-Type": "Event"})
    wrong: list[dict[str, Any]] = [
        {"secret": "another"},
        {"body": b'{"a": 2}'},
        {"path": "/lambda/2015-03-31/functions/other"},
        {"path": f"{PATHS[0]}?x=1"},
        {"headers": altered(headers, b"host", b"other.example")},
        {"headers": altered(headers, b"x-amz-invocation-type", b"DryRun")},
        {"headers": [*headers, (b"host", HOST.encode())]},
    ]
    for change in wrong:
        with pytest.raises(SignatureWrongError):
            check(change.pop("headers", headers), **change)
    authorization = dict(headers)[b"authorization"]
    for last in (b"11" if authorization.endswith(b"00") else b"00", b"\xff\xff"):
        with pytest.raises(SignatureWrongError):
            check(altered(headers, b"authorization", authorization[:-2] + last))


def test_a_body_that_is_not_signed_is_refused() -> None:
    for said in ("UNSIGNED-PAYLOAD", "STREAMING-AWS4-HMAC-SHA256-PAYLOAD", hashlib.sha256(b"else").hexdigest()):
        with pytest.raises(SignatureWrongError, match="SHA256"):
            check(signed(**{"X-Amz-Content-SHA256": said}))
    check(signed(**{"X-Amz-Content-SHA256": hashlib.sha256(BODY).hexdigest()}))


def test_what_lacks_a_part_says_so() -> None:
    headers = signed()
    authorization = dict(headers)[b"authorization"]
    cases: list[tuple[Headers, type[MetarosError]]] = [
        ([], UnsignedError),
        ([(b"authorization", b"Bearer mrk_x")], UnsignedError),
        ([*headers, (b"authorization", authorization)], UnsignedError),
        (altered(headers, b"authorization", authorization.replace(b"aws4_request", b"x")), SignatureIncompleteError),
        (altered(headers, b"authorization", authorization.replace(b"/lambda/", b"/s3/")), SignatureIncompleteError),
        (altered(headers, b"authorization", authorization.replace(b"host;", b"")), SignatureIncompleteError),
        (altered(headers, b"authorization", authorization.split(b", Signature")[0]), SignatureIncompleteError),
        ([pair for pair in headers if pair[0] != b"x-amz-date"], SignatureIncompleteError),
        ([*headers, (b"x-amz-log-type", b"Tail")], SignatureIncompleteError),
        (altered(headers, b"x-amz-date", b"20010101T000000Z"), SignatureIncompleteError),
        (signed(token="session"), UnknownAccessKeyError),
    ]
    for given, error in cases:
        with pytest.raises(error):
            check(given)


def test_a_signature_in_a_query_does_not_count() -> None:
    request = AWSRequest("GET", f"http://{HOST}{PATHS[0]}")
    SigV4QueryAuth(Credentials("0123456789abcdef", SECRET), "lambda", "local").add_auth(request)
    assert "X-Amz-Signature" in request.url
    with pytest.raises(UnsignedError):
        read_signature([(b"host", HOST.encode())])


def test_it_is_good_for_five_minutes_either_way() -> None:
    signature = read_signature(signed())
    made_ns = round(datetime.strptime(signature.time, "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC).timestamp()) * 10**9
    for off_s in (-300, 0, 300):
        check_time(signature, now_ns=made_ns + off_s * 10**9)
    for off_s, word in ((-301, "not yet current"), (301, "expired")):
        with pytest.raises(SignatureExpiredError, match=word):
            check_time(signature, now_ns=made_ns + off_s * 10**9)
