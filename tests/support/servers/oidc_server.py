"""A small OpenID Connect provider over real HTTP: code flow with PKCE, and every wrong answer a test asks for."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import secrets
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from joserfc import jwt
from joserfc.jwk import RSAKey

from metaros.clock import SystemClock

__all__ = ["CLIENT_ID", "CLIENT_SECRET", "OidcServer", "another_key", "oidc_server"]

CLIENT_ID, CLIENT_SECRET = "meta ros/1", "s3cret:with/odd %"
_BASIC = base64.b64encode(b"meta%20ros%2F1:s3cret%3Awith%2Fodd%20%25").decode()


class OidcServer:
    """What it answers is changed by its fields; everybody is signed in as `user` without being asked."""

    def __init__(self) -> None:
        self.user: dict[str, Any] = {"sub": "u-1", "preferred_username": "Ada L", "groups": ["robot-ops"]}
        self.claims: dict[str, Any] = {}  # of the next tokens, over the right ones; None leaves one out
        self.discovery: dict[str, Any] = {}
        self.answers: dict[str, tuple[int, bytes, dict[str, str]]] = {}  # by path: status, body, headers
        self.algorithm = "RS256"
        self.kid = "k1"
        self.key = _first_key()
        self.signing: Any = None  # another key than the published one
        self.codes: dict[str, dict[str, str]] = {}
        self.asked: list[str] = []
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._server.daemon_threads = True
        self.issuer = f"http://127.0.0.1:{self._server.server_port}"
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def new_key(self) -> None:
        """As providers do now and then."""
        self.kid += "1"
        self.key = RSAKey.import_key({**another_key().as_dict(private=True), "kid": self.kid})

    @contextmanager
    def saying(self, **fields: Any) -> Iterator[None]:
        """With other fields, until the end of the block."""
        before = {name: getattr(self, name) for name in fields}
        vars(self).update(fields)
        try:
            yield
        finally:
            vars(self).update(before)

    def get(self, path: str, query: dict[str, str]) -> tuple[int, bytes, dict[str, str]]:
        """A GET's answer."""
        if path == "/.well-known/openid-configuration":
            places = {"authorization_endpoint": "authorize", "token_endpoint": "token", "jwks_uri": "jwks"}
            found = {name: f"{self.issuer}/{place}" for name, place in places.items()}
            return _json({"issuer": self.issuer, **found, **self.discovery})
        if path == "/jwks":
            return _json({"keys": [self.key.as_dict(private=False), {"kty": "oct", "k": "c2hhcmVk"}]})
        if path == "/authorize":
            assert query["response_type"] == "code"
            assert query["code_challenge_method"] == "S256"
            assert "openid" in query["scope"].split()
            code = secrets.token_urlsafe(16)
            self.codes[code] = query
            back = urlencode({"code": code, "state": query["state"]})
            return 302, b"", {"Location": f"{query['redirect_uri']}?{back}"}
        return 404, b"", {}

    def token(self, form: dict[str, str], authorization: str) -> tuple[int, bytes, dict[str, str]]:
        """The token endpoint: a code works once, for who can show the verifier."""
        query = self.codes.pop(form.get("code", ""), None)
        challenge = base64.urlsafe_b64encode(hashlib.sha256(form.get("code_verifier", "").encode()).digest())
        if (
            query is None
            or authorization != f"Basic {_BASIC}"
            or query["code_challenge"] != challenge.decode().rstrip("=")
            or (form.get("redirect_uri"), form.get("client_id")) != (query["redirect_uri"], CLIENT_ID)
        ):
            return 400, b'{"error": "invalid_grant"}', {}
        return _json({"access_token": "a", "token_type": "Bearer", "id_token": self.id_token(query["nonce"])})

    def id_token(self, nonce: str) -> str:
        """A token as the fields say."""
        now_s = SystemClock().wall_ns() // 10**9
        right = {"iss": self.issuer, "aud": CLIENT_ID, "iat": now_s, "exp": now_s + 300, "nonce": nonce, **self.user}
        claims = {key: value for key, value in {**right, **self.claims}.items() if value is not None}
        header = {"alg": self.algorithm, "kid": self.kid}
        if self.algorithm == "RS256":
            return jwt.encode(header, claims, self.signing or self.key)
        text = f"{_part(json.dumps(header).encode())}.{_part(json.dumps(claims).encode())}"
        if self.algorithm == "none":
            return f"{text}."
        # HS256 with the public key's text as the shared secret: what a careless client takes.
        secret = self.key.as_pem(private=False)
        return f"{text}.{_part(hmac.digest(secret, text.encode(), 'sha256'))}"


@contextmanager
def oidc_server() -> Iterator[OidcServer]:
    """A provider on a free port."""
    server = OidcServer()
    try:
        yield server
    finally:
        server.close()


@lru_cache(maxsize=1)
def _first_key() -> RSAKey:
    """Made once: it takes a while."""
    return RSAKey.generate_key(2048, {"kid": "k1"})


@lru_cache(maxsize=1)
def another_key() -> RSAKey:
    """Of whoever else signs with a key that is called the same."""
    return RSAKey.generate_key(2048, {"kid": "k1"})


def _part(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


def _json(document: Any) -> tuple[int, bytes, dict[str, str]]:
    return 200, json.dumps(document).encode(), {"Content-Type": "application/json"}


def _handler(server: OidcServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Answers one request."""

        def do_GET(self) -> None:
            parts = urlsplit(self.path)
            server.asked.append(parts.path)
            self._answer(server.answers.get(parts.path) or server.get(parts.path, dict(parse_qsl(parts.query))))

        def do_POST(self) -> None:
            server.asked.append(self.path)
            form = dict(parse_qsl(self.rfile.read(int(self.headers["Content-Length"])).decode()))
            known = server.token(form, self.headers.get("Authorization", ""))
            self._answer(server.answers.get(self.path) or known)

        def _answer(self, answer: tuple[int, bytes, dict[str, str]]) -> None:
            status, body, headers = answer
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_args: Any) -> None:
            """Nothing."""

    return Handler
