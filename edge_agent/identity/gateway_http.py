"""The gateway's HTTP API as enrolment and renewal use it: small JSON requests over verified TLS.

Trust is one of two. The fleet's root is the only authority where the gateway ends TLS itself; where a proxy ends it
with a certificate of its own, this system's authorities may vouch for that, too. On this machine it may go without TLS.
"""

from __future__ import annotations

import ipaddress
import json
import ssl
import urllib.error
import urllib.request
from http.client import HTTPException, HTTPMessage
from typing import IO, Any
from urllib.parse import urlsplit

from edge_agent.errors import EnrolAnswerError, EnrolError, EnrolRefusedError, InsecureGatewayError, UntrustedError
from metaros.errors import ConfigError

__all__ = ["GatewayHttpClient", "check_url", "is_loopback", "unverified", "verified"]

ANSWER_BYTES = 64 * 1024
TIMEOUT_S = 30.0
API = "/api/v1"


def is_loopback(host: str) -> bool:
    """Whether a host name or number is this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def check_url(url: str) -> str:
    """The gateway's URL without a slash at its end.

    Raises:
        ConfigError: it is no http or https URL of a host.
        InsecureGatewayError: it is plain http to another machine.
    """
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError as error:
        raise ConfigError(f"--gateway {url!r}: {error}") from error
    if parts.scheme not in ("http", "https") or not parts.hostname or port == 0:
        raise ConfigError(f"--gateway must be the gateway's URL, https://HOST[:PORT], not {url!r}")
    if "@" in parts.netloc or parts.query or parts.fragment:
        raise ConfigError(f"--gateway {url!r}: the URL has no user, query or fragment")
    if parts.scheme == "http" and not is_loopback(parts.hostname):
        raise InsecureGatewayError(f"{url} has no TLS: beyond this machine a robot enrols at https:// only")
    return url.rstrip("/")


def unverified() -> ssl.SSLContext:
    """TLS to whoever answers: for the public roots alone, which the pin then vouches for."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def verified(roots_pem: str, *, system: bool = False) -> ssl.SSLContext:
    """TLS that these roots vouch for; with `system` also the authorities of this system."""
    context = ssl.create_default_context(cadata=None if system else roots_pem)
    if system:
        context.load_verify_locations(cadata=roots_pem)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    return context


class GatewayHttpClient:
    """HTTP client for one gateway. `tls` is used for https."""

    def __init__(self, url: str, tls: ssl.SSLContext) -> None:
        self._url = check_url(url)
        self._opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=tls), _NoRedirect())
        if is_loopback(urlsplit(url).hostname or ""):  # no forward proxy is asked for this machine
            self._opener = urllib.request.build_opener(
                urllib.request.ProxyHandler({}), urllib.request.HTTPSHandler(context=tls), _NoRedirect()
            )

    def get(self, path: str) -> dict[str, Any]:
        """The JSON object there. Blocks for at most 30 s between two pieces of the answer.

        Raises:
            EnrolRefusedError: the gateway said no; `reason` is its code.
            UntrustedError: its TLS certificate is not vouched for.
            EnrolAnswerError: the answer is too large, or no JSON object.
            EnrolError: it cannot be reached.
        """
        return self._ask(urllib.request.Request(self._url + API + path))

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        """The answer to a JSON object; errors as with `get`."""
        data = json.dumps(body).encode()
        headers = {"Content-Type": "application/json"}
        return self._ask(urllib.request.Request(self._url + API + path, data, headers, method="POST"))

    def _ask(self, request: urllib.request.Request) -> dict[str, Any]:
        request.add_header("Accept", "application/json")
        try:
            with self._opener.open(request, timeout=TIMEOUT_S) as response:
                return _object(response)
        except urllib.error.HTTPError as error:
            with error:
                raise _refused(error) from None
        except urllib.error.URLError as error:
            raise _unreached(self._url, error.reason) from error
        except (OSError, HTTPException) as error:
            raise _unreached(self._url, error) from error


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A token goes to the gateway that was named, and nowhere else."""

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> None:
        return None


def _object(response: IO[bytes]) -> dict[str, Any]:
    data = response.read(ANSWER_BYTES + 1)
    if len(data) > ANSWER_BYTES:
        raise EnrolAnswerError(f"the gateway's answer is over {ANSWER_BYTES} bytes")
    try:
        table = json.loads(data)
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise EnrolAnswerError("what answered there is no Meta-ROS gateway: it sent no JSON object")
    return table


def _refused(error: urllib.error.HTTPError) -> EnrolError:
    """What a problem document says; whatever else answers is named by its status."""
    try:
        table = _object(error)
    except (EnrolAnswerError, OSError, HTTPException):
        table = {}
    code, detail = table.get("code"), table.get("detail")
    if not isinstance(code, str):
        return EnrolAnswerError(f"what answered there is no Meta-ROS gateway that enrols robots: HTTP {error.code}")
    return EnrolRefusedError(code[:64], detail[:512] if isinstance(detail, str) else "")


def _unreached(url: str, reason: object) -> EnrolError:
    if isinstance(reason, ssl.SSLCertVerificationError):
        return UntrustedError(f"{url}: its TLS certificate is not to be trusted: {reason.verify_message}")
    if isinstance(reason, OSError):
        return EnrolError(f"cannot reach {url}: {reason.strerror or reason or type(reason).__name__}")
    return EnrolError(f"cannot reach {url}: {reason}")
