"""Signatures of AWS's fourth version, checked by making them again; the tests compare with botocore's own signer.

A signature has to cover the host, the time, every `x-amz-` header and the body; one that says that its body is not
signed is refused, as is one in a query. Which region it names does not matter: here is only one.
"""

from __future__ import annotations

import functools
import hashlib
import hmac
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from urllib.parse import quote

from botocore.utils import normalize_url_path

from gateway.api.aws.errors import (
    SignatureExpiredError,
    SignatureIncompleteError,
    SignatureWrongError,
    UnknownAccessKeyError,
    UnsignedError,
)
from metaros.limits import LIMITS

__all__ = ["Signature", "check_time", "read_signature", "verify"]

ALGORITHM, SERVICE = "AWS4-HMAC-SHA256", "lambda"
_CREDENTIAL = re.compile(r"([^/]{1,128})/([0-9]{8})/([a-z0-9-]{1,64})/([a-z0-9-]{1,64})/aws4_request")
_NAMES = re.compile(r"[a-z0-9-]+(?:;[a-z0-9-]+){0,63}")
_PARTS = {"Credential", "SignedHeaders", "Signature"}
_TIME = re.compile(r"[0-9]{8}T[0-9]{6}Z")


@dataclass(frozen=True, slots=True)
class Signature:
    """What an Authorization header and those beside it say."""

    key_id: str
    region: str
    time: str
    names: tuple[str, ...]  # of the headers that it covers
    value: str
    headers: tuple[tuple[str, str], ...]  # all of the request's, names in small letters


def read_signature(headers: Sequence[tuple[bytes, bytes]]) -> Signature:
    """The signature of a request.

    Raises:
        UnsignedError: it has none.
        SignatureIncompleteError: it cannot be read, or leaves out what has to be signed.
        UnknownAccessKeyError: it comes with a session's token, which no key here has.
    """
    said = tuple((name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in headers)
    values = [value for name, value in said if name == "authorization"]
    if len(values) != 1 or not values[0].startswith(f"{ALGORITHM} "):
        raise UnsignedError("Missing Authentication Token: sign the request with a key of the scope lambda")
    parts = dict(_pair(part) for part in values[0].removeprefix(ALGORITHM).split(","))
    credential = _CREDENTIAL.fullmatch(parts.get("Credential", ""))
    if set(parts) != _PARTS or credential is None or _NAMES.fullmatch(parts["SignedHeaders"]) is None:
        raise SignatureIncompleteError(
            "Authorization has a Credential (…/lambda/aws4_request), SignedHeaders, Signature"
        )
    names = tuple(parts["SignedHeaders"].split(";"))
    _check_covered(said, names)
    time = _one(said, "x-amz-date")
    key_id, day, region, service = credential.groups()
    if service != SERVICE or not time.startswith(day):
        raise SignatureIncompleteError(
            f"Credential should be scoped to the service {SERVICE} and to the day of X-Amz-Date"
        )
    if any(name == "x-amz-security-token" for name, _ in said):
        raise UnknownAccessKeyError("The security token included in the request is invalid.")
    return Signature(key_id, region, time, names, parts["Signature"], said)


def check_time(signature: Signature, *, now_ns: int) -> None:
    """SignatureExpiredError for one that was not made about now."""
    try:
        if _TIME.fullmatch(signature.time) is None:
            raise ValueError(signature.time)
        made_s = datetime.fromisoformat(signature.time).timestamp()
    except ValueError as error:
        raise SignatureIncompleteError("X-Amz-Date is like 20261122T180000Z") from error
    off_s = now_ns / 1e9 - made_s
    if abs(off_s) > LIMITS.lambda_skew_s:
        word = "expired" if off_s > 0 else "not yet current"
        raise SignatureExpiredError(
            f"Signature {word}: {signature.time} is {abs(off_s):.0f} s from the gateway's time, at most"
            f" {LIMITS.lambda_skew_s:g} s may be"
        )


def verify(signature: Signature, secret: str, *, method: str, path: str, query: str, sha256: str) -> None:
    """Return when it is the signature of this request, whose body has that SHA-256; path and query as they came.

    Raises:
        SignatureWrongError: it is not.
    """
    said = [value for name, value in signature.headers if name == "x-amz-content-sha256"]
    if said and said != [sha256]:
        raise SignatureWrongError(
            "X-Amz-Content-SHA256 is not that of the body; bodies that are not signed are refused"
        )
    canonical = _canonical(signature, method=method, path=path, query=query, sha256=sha256)
    day = signature.time[:8]
    digest = hashlib.sha256(canonical.encode()).hexdigest()
    text = f"{ALGORITHM}\n{signature.time}\n{day}/{signature.region}/{SERVICE}/aws4_request\n{digest}"
    expected = hmac.digest(_signing_key(secret, day, signature.region), text.encode(), "sha256").hex()
    if not hmac.compare_digest(expected.encode(), signature.value.encode("utf-8", "surrogatepass")):
        raise SignatureWrongError(
            "The request signature we calculated does not match the signature you provided: check the secret access"
            " key, and that nothing on the way changes the request"
        )


def _canonical(signature: Signature, *, method: str, path: str, query: str, sha256: str) -> str:
    """What is signed, as AWS's guide "Create a signed AWS API request" has it: the path is encoded once more."""
    names = sorted(set(signature.names))
    values: dict[str, list[str]] = {name: [] for name in names}
    for name, value in signature.headers:
        if name in values:
            values[name].append(" ".join(value.split()))
    pairs = sorted(pair.partition("=")[::2] for pair in query.split("&")) if query else []
    lines = [
        method.upper(),
        quote(normalize_url_path(path), safe="/~"),
        "&".join(f"{key}={value}" for key, value in pairs),
        *(f"{name}:{','.join(said)}" for name, said in values.items()),
        "",
        ";".join(names),
        sha256,
    ]
    return "\n".join(lines)


@functools.lru_cache(maxsize=256)
def _signing_key(secret: str, day: str, region: str) -> bytes:
    """Of a secret, for a day."""
    key = f"AWS4{secret}".encode()
    for part in (day, region, SERVICE, "aws4_request"):
        key = hmac.digest(key, part.encode(), "sha256")
    return key


def _pair(part: str) -> tuple[str, str]:
    name, _, value = part.strip().partition("=")
    return name, value


def _one(said: Sequence[tuple[str, str]], wanted: str) -> str:
    values = [value for name, value in said if name == wanted]
    if len(values) != 1:
        raise SignatureIncompleteError(f"Authorization needs one {wanted} header")
    return values[0]


def _check_covered(said: Sequence[tuple[str, str]], names: Sequence[str]) -> None:
    """What says what is to be done has to be signed."""
    present = {name for name, _ in said}
    wanted = {"host", "x-amz-date", *(name for name in present if name.startswith("x-amz-"))}
    if missing := sorted(wanted - set(names)):
        raise SignatureIncompleteError(f"SignedHeaders lacks {', '.join(missing)[:200]}")
    if absent := sorted(set(names) - present):
        raise SignatureIncompleteError(f"SignedHeaders names {', '.join(absent)[:200]}, which did not come")
