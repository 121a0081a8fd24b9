"""Enrolment and renewal against a real HTTPS door: what is sent, what is kept, and what is refused."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from edge_agent.errors import (
    EnrolAnswerError,
    EnrolError,
    EnrolRefusedError,
    InsecureGatewayError,
    PinError,
    UntrustedError,
)
from edge_agent.identity.enrol import enrol, renew
from edge_agent.identity.enrolment_token import parse_token
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.key import key_from_pem, new_key, public_der
from metaros.errors import ConfigError
from tests.support.servers.enrol_server import EnrolServer, enrol_server
from tests.support.servers.fleet_ca import FleetCa


def enrol_at(server: EnrolServer, state: Path, *, token: str = "", robot: str = "arm") -> RobotIdentity:
    """Enrol a robot there."""
    return enrol(parse_token(token or server.ca.token()), url=server.url, robot_id=robot, state_dir=state)


def test_a_token_becomes_an_identity_whose_key_never_left(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        identity = enrol_at(server, tmp_path)
        sent = repr(server.asked)
    assert IdentityFiles(tmp_path).load() == identity
    assert (identity.robot, identity.fleet, identity.system_trust) == ("arm", server.ca.fleet, False)
    assert "PRIVATE" not in sent
    assert not (tmp_path / "identity" / "pending.json").exists()


def test_a_lost_answer_is_asked_for_again_with_the_same_key(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        server.drop = 1
        with pytest.raises(EnrolError):
            enrol_at(server, tmp_path)
        assert IdentityFiles(tmp_path).load() is None
        enrol_at(server, tmp_path)
        first, second = [body["csr"] for path, body in server.asked if path.endswith("/enrol")]
        keys = {repr(_public(csr)) for csr in (first, second)}
    assert len(keys) == 1


def test_another_fleets_gateway_never_sees_the_token(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        with pytest.raises(PinError, match="another key"):
            enrol_at(server, tmp_path, token=FleetCa().token())
        assert server.times("/enrol") == 0


def test_somebody_between_shows_the_right_root_and_gets_nothing(tmp_path: Path) -> None:
    with enrol_server(tmp_path, served_by=FleetCa()) as server:
        with pytest.raises(UntrustedError, match="authorities"):
            enrol_at(server, tmp_path)
        assert server.times("/enrol") == 0


def test_a_proxy_that_this_system_trusts_may_end_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    public = FleetCa("public")
    (tmp_path / "public.pem").write_text(public.roots)
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "public.pem"))
    with enrol_server(tmp_path, served_by=public) as server:
        identity = enrol_at(server, tmp_path)
        assert identity.system_trust
        assert renew(identity, tmp_path).system_trust


@pytest.mark.parametrize("code", ["token_used", "token_expired", "token_unknown", "token_foreign", "csr_refused"])
def test_a_refusal_is_named_and_leaves_what_was(tmp_path: Path, code: str) -> None:
    with enrol_server(tmp_path) as server:
        before = enrol_at(server, tmp_path)
        server.refuse = code
        with pytest.raises(EnrolRefusedError, match=code) as error:
            enrol_at(server, tmp_path, token=server.ca.token("t2"))
    assert error.value.reason == code
    assert IdentityFiles(tmp_path).load() == before
    assert not (tmp_path / "identity" / "pending.json").exists()


def other_key(answer: dict[str, Any], ca: FleetCa) -> dict[str, Any]:
    """A certificate for another key."""
    return {**answer, "certificate": ca.robot(new_key().public_key(), "arm")}


TWISTS = {
    "another key": other_key,
    "another robot": lambda answer, ca: {**answer, "robot": "leg"},
    "another fleet": lambda answer, ca: {**answer, "fleet": "other"},
    "no chain": lambda answer, ca: {**answer, "chain": ""},
    "a foreign chain": lambda answer, ca: {**answer, "chain": FleetCa().chain},
    "no certificate": lambda answer, ca: {**answer, "certificate": "hello"},
    "foreign roots": lambda answer, ca: {**answer, "roots": FleetCa().roots},
    "a port that is none": lambda answer, ca: {**answer, "grpc_port": 70000},
}


@pytest.mark.parametrize("name", TWISTS)
def test_an_answer_that_does_not_hold_is_not_kept(tmp_path: Path, name: str) -> None:
    with enrol_server(tmp_path) as server:
        server.twist = lambda answer: TWISTS[name](answer, server.ca)
        with pytest.raises(EnrolAnswerError):
            enrol_at(server, tmp_path)
    assert IdentityFiles(tmp_path).load() is None


def test_a_certificate_for_another_name_is_not_kept(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:

        def twist(answer: dict[str, Any]) -> dict[str, Any]:
            key = IdentityFiles(tmp_path).pending_key("token t1 arm")
            return {**answer, "certificate": server.ca.robot(key.public_key(), "leg")}

        server.twist = twist
        with pytest.raises(EnrolAnswerError, match="not for arm"):
            enrol_at(server, tmp_path)


def test_renewal_has_a_new_key_on_the_word_of_the_old_one(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        first = enrol_at(server, tmp_path)
        second = renew(first, tmp_path)
        third = renew(second, tmp_path)
    keys = {public_der(key_from_pem(item.key)) for item in (first, second, third)}
    assert len(keys) == 3
    assert IdentityFiles(tmp_path).load() == third


def test_a_lost_renewal_asks_again_with_the_same_new_key(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        identity = enrol_at(server, tmp_path)
        for _ in range(2):
            server.drop = 2  # the challenge's answer first, then the renewal's is still there
            with pytest.raises(EnrolError):
                renew(identity, tmp_path)
        server.drop = 0
        server.refuse = "certificate_revoked"
        with pytest.raises(EnrolRefusedError, match="certificate_revoked"):
            renew(identity, tmp_path)
        server.refuse = ""
        real, server.answer = server.answer, _losing(server)  # type: ignore[method-assign]
        with pytest.raises(EnrolError):
            renew(identity, tmp_path)
        server.answer = real  # type: ignore[method-assign]
        renew(identity, tmp_path)
        requests = [body["csr"] for path, body in server.asked if path.endswith("/renew")]
    assert len(requests) == 2
    assert _public(requests[0]) == _public(requests[1])


def _losing(server: EnrolServer) -> Any:
    """Answers, but loses the answer to a renewal."""
    real = server.answer

    def answer(path: str, body: dict[str, Any]) -> Any:
        server.drop = int(path.endswith("/renew"))
        return real(path, body)

    return answer


def test_a_fleet_passes_to_another_root_by_a_renewal(tmp_path: Path) -> None:
    with enrol_server(tmp_path) as server:
        identity = enrol_at(server, tmp_path)
        both = server.ca.roots + FleetCa().roots
        server.twist = lambda answer: {**answer, "roots": both}
        assert renew(identity, tmp_path).roots == both


@pytest.mark.parametrize("url", ["http://example.org", "http://10.0.0.1:8080"])
def test_beyond_this_machine_there_is_no_enrolment_without_tls(tmp_path: Path, url: str) -> None:
    with pytest.raises(InsecureGatewayError, match="https"):
        enrol(parse_token(FleetCa().token()), url=url, robot_id="arm", state_dir=tmp_path)


@pytest.mark.parametrize(
    "url", ["example.org", "ftp://a", "https://a:b@c", "https://a?b", "https://", "https://a:99999"]
)
def test_what_is_no_url_is_refused(tmp_path: Path, url: str) -> None:
    with pytest.raises(ConfigError):
        enrol(parse_token(FleetCa().token()), url=url, robot_id="arm", state_dir=tmp_path)


@pytest.mark.parametrize("kind", ["html", "huge", "redirect"])
def test_something_else_on_the_port_is_reported_apart(tmp_path: Path, kind: str) -> None:
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            data = b"<html>" if kind == "html" else b'"' + b"x" * 100_000 + b'"'
            self.send_response(302 if kind == "redirect" else 200)
            self.send_header("Location", "/elsewhere")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_request(self, *_args: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        with pytest.raises(EnrolError):
            enrol(
                parse_token(FleetCa().token()),
                url=f"http://127.0.0.1:{server.server_port}",
                robot_id="arm",
                state_dir=tmp_path,
            )
        thread.join()
    assert asked == ["/api/v1/enrol/roots"]


def _public(csr: str) -> bytes:
    from cryptography import x509
    from cryptography.hazmat.primitives import serialization

    key = x509.load_pem_x509_csr(csr.encode()).public_key()
    return key.public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)
