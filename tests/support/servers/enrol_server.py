"""The enrolment endpoint of a gateway as a small HTTPS server with scripted answers; it records requests."""

from __future__ import annotations

import base64
import json
import os
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import serialization

from metaros.link.proof import renew_statement, verify
from tests.support.servers.fleet_ca import FleetCa

__all__ = ["EnrolServer", "enrol_server"]

Answer = tuple[int, dict[str, Any]]


class EnrolServer:
    """What the server says. Set `twist` to change an answer, `refuse` to refuse, `drop` to lose answers."""

    def __init__(self, ca: FleetCa) -> None:
        self.ca = ca
        self.url = ""
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self.nonces: set[bytes] = set()
        self.refuse = ""
        self.drop = 0
        self.life = timedelta(days=2)
        self.grpc_port, self.grpc_tls = 0, True
        self.twist: Callable[[dict[str, Any]], dict[str, Any]] = lambda answer: answer

    def answer(self, path: str, body: dict[str, Any]) -> Answer:
        """The answer to a request, as status and JSON."""
        self.asked.append((path, body))
        if path == "/api/v1/enrol/roots":
            return 200, {"fleet": self.ca.fleet, "roots": self.ca.roots}
        if self.refuse:
            return 403, {"code": self.refuse, "detail": "no"}
        if path == "/api/v1/enrol/challenge":
            nonce = os.urandom(32)
            self.nonces.add(nonce)
            text = base64.urlsafe_b64encode(nonce).rstrip(b"=").decode()
            return 200, {"nonce": text, "audience": self.ca.fleet, "valid_s": 60}
        csr = x509.load_pem_x509_csr(body["csr"].encode())
        if path == "/api/v1/enrol/renew":
            self.check_proof(body, csr)
        certificate = self.ca.robot(csr.public_key(), body["robot"], life=self.life)
        return 201, self.twist(
            {
                "robot": body["robot"],
                "fleet": self.ca.fleet,
                "certificate": certificate,
                "chain": self.ca.chain,
                "roots": self.ca.roots,
                "grpc_port": self.grpc_port,
                "grpc_tls": self.grpc_tls,
            }
        )

    def check_proof(self, body: dict[str, Any], csr: x509.CertificateSigningRequest) -> None:
        """That the old key signed this request and this nonce."""
        old = x509.load_pem_x509_certificate(body["certificate"].encode())
        nonce = base64.urlsafe_b64decode(body["nonce"] + "=")
        self.nonces.remove(nonce)
        der = csr.public_bytes(serialization.Encoding.DER)
        statement = renew_statement(nonce, audience=self.ca.fleet, robot_id=body["robot"], csr_der=der)
        proof = base64.urlsafe_b64decode(body["proof"] + "=" * (-len(body["proof"]) % 4))
        assert verify(old.public_key(), statement, proof)

    def times(self, path: str) -> int:
        """How often a path was asked."""
        return sum(asked == f"/api/v1{path}" for asked, _ in self.asked)


@contextmanager
def enrol_server(folder: Path, ca: FleetCa | None = None, *, served_by: FleetCa | None = None) -> Iterator[EnrolServer]:
    """A door of that fleet on this machine; `served_by`: TLS with another authority's certificate."""
    authenticator = EnrolServer(ca or FleetCa())

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._say(*authenticator.answer(self.path, {}))

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            status, answer = authenticator.answer(self.path, body)
            if authenticator.drop:
                authenticator.drop -= 1
                self.close_connection = True
                return
            self._say(status, answer)

        def _say(self, status: int, answer: dict[str, Any]) -> None:
            data = json.dumps(answer).encode()
            self.send_response(status)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_request(self, *_args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    key, chain = (served_by or authenticator.ca).server()
    (folder / "door.pem").write_text(key + chain)
    context.load_cert_chain(folder / "door.pem")
    server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    authenticator.url = f"https://localhost:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield authenticator
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
