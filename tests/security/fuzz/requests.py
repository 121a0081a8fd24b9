"""Targets of what strangers send to gateway and agent: requests, cursors, times, credentials, certificates, tokens."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.utils import CryptographyDeprecationWarning
from pydantic import BaseModel, ValidationError

from edge_agent.errors import EnrolAnswerError, IdentityFileError, PinError, TokenFormatError
from edge_agent.identity import enrolment_token
from edge_agent.identity.certificate import check_issued
from edge_agent.identity.enrol import _from_base64
from edge_agent.identity.files import IdentityFiles
from edge_agent.identity.key import key_to_pem, new_key
from gateway.api.middleware.authenticate import _credential
from gateway.api.models import common, enrol, history, identity, recordings
from gateway.api.rest.ranges import chosen_topics, parse_age
from gateway.api.rest.times import parse_time
from gateway.api.ws.requests import make_feed, number_field, read_request, read_samples, text_field
from gateway.domain.fleet.recording import is_recording_id
from gateway.domain.principal import Principal, Role
from gateway.domain.robot import is_robot_id
from gateway.errors import CredentialsError, IdentityError, InvalidRequestError
from gateway.history.cursor import read_cursor, write_cursor
from gateway.identity.certificates import tokens
from gateway.identity.certificates.parsing import check_csr, load_certificate, read_robot
from gateway.identity.keys import parse_key
from gateway.store.objects.store import check_name
from metaros.access.credentials import key_for
from metaros.cdr import codec
from metaros.errors import ConfigError, FieldError, NameError_
from metaros.idl import message_class
from metaros.idl.json import from_json
from tests.security.fuzz.files import on_disk
from tests.security.fuzz.target import Target
from tests.security.fuzz.wire import text_of
from tests.support.servers.fleet_ca import FleetCa, pem

__all__ = ["TARGETS"]

NOW_NS = 1_800_000_000 * 10**9
VIEWER = Principal(kind="user", id="u1", name="ada", role=Role.VIEWER, robots=("sim_*",))
BODIES: tuple[type[BaseModel], ...] = tuple(
    dict.fromkeys(
        found
        for module in (common, enrol, history, identity, recordings)
        for found in vars(module).values()
        if isinstance(found, type) and issubclass(found, BaseModel) and found is not BaseModel
    )
)


def stream_request(data: bytes) -> None:
    """A text on the stream's socket, and on the teleop socket."""
    request = read_request(text_of(data))
    for low, high in ((0.0, 10.0), (-100.0, 100.0)):
        for name in ("linear", "max_rate_hz"):
            try:
                number_field(request, name, 1.0, low=low, high=high)
            except InvalidRequestError:
                continue
    if request.get("op") == "subscribe":
        assert read_samples(request, VIEWER).queue_bytes > 0
    elif request.get("op") in ("subscribe_metrics", "subscribe_fleet"):
        assert make_feed(request, revisions=dict, describe=lambda _: {}, principal=VIEWER) is not None
    else:
        text_field(request, "holder")


def body(data: bytes) -> None:
    """A request's body, as every model of the API; the first byte says which."""
    model = BODIES[data[0] % len(BODIES)] if data else BODIES[0]
    model.model_validate_json(data[1:])


def json_message(data: bytes) -> None:
    """A message that somebody publishes as JSON; the first byte says of which type."""
    value = orjson.loads(data[1:])
    cls = message_class(JSON_TYPES[data[0] % len(JSON_TYPES)] if data else JSON_TYPES[0])
    codec(cls).encode(from_json(cls, value))


JSON_TYPES = (
    "std_msgs/msg/String",
    "geometry_msgs/msg/Twist",
    "sensor_msgs/msg/LaserScan",
    "diagnostic_msgs/msg/DiagnosticArray",
    "std_msgs/msg/ByteMultiArray",
    "example_interfaces/msg/WString",
)
JSON_SEEDS: tuple[Any, ...] = (
    {"data": "hallo"},
    {"linear": {"x": 1.5}, "angular": {"z": None}},
    {"ranges": [1, 2.5, None], "angle_min": -1},
    {"status": [{"name": "a", "values": [{"key": "k", "value": "v"}]}]},
    {"data": [1, 2, 255]},
    {"data": "grüße"},
)


def headers(data: bytes) -> None:
    """Authorization, cookies and the key in a WebSocket's subprotocol."""
    lines = data.split(b"\n")
    scope = {
        "type": "http",
        "method": "GET",
        "path": "/api/v1/robots",
        "headers": [(name.lower(), value) for name, _, value in (line.partition(b": ") for line in lines)],
        "subprotocols": [line.decode("latin-1") for line in lines if line.startswith(b"metaros")],
    }
    found, _ = _credential(scope)
    if found is not None:
        assert "secret" not in repr(found)


def times(text: str) -> None:
    """A time and an age in a query."""
    with contextlib.suppress(InvalidRequestError):
        parse_age(text)
    assert isinstance(parse_time(text, now_ns=NOW_NS), int)


def names(text: str) -> None:
    """What becomes a name of something: an id, an object, a pattern."""
    is_robot_id(text)
    is_recording_id(text)
    with contextlib.suppress(ConfigError):
        check_name(text)
    chosen_topics(["/sim_1/odom"], [text], namespace="/sim_1")


def csr(data: bytes) -> None:
    """A certificate request as PEM, or as the PEM of any DER."""
    text = text_of(data) if data.startswith(b"-----") else as_pem(data, "CERTIFICATE REQUEST")
    check_csr(text, fleet="testfleet", robot="r1")


def certificate(data: bytes) -> None:
    """A certificate that a lane's Hello brings, or a renewal."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CryptographyDeprecationWarning)  # a serial number that is not positive
        found = load_certificate(data)
    now_ns = round(found.not_valid_before_utc.timestamp() + 1) * 10**9
    read_robot(found, [CA.intermediate], fleet="testfleet", now_ns=now_ns)


def answer(data: bytes) -> None:
    """What a gateway answers to an agent that enrols."""
    text = text_of(data)
    enrolment_token.pinned_roots(data, CA.pin)
    check_issued(text, CA.chain, CA.roots, key=KEY, fleet="testfleet", robot_id="r1")


def issued(data: bytes) -> None:
    """The certificate that comes back: only ours is taken."""
    check_issued(text_of(data), CA.chain, CA.roots, key=KEY, fleet="testfleet", robot_id="r1")


def as_pem(data: bytes, label: str) -> str:
    """DER as text."""
    lines = base64.encodebytes(data).decode()
    return f"-----BEGIN {label}-----\n{lines}-----END {label}-----\n"


def request_der() -> bytes:
    """A good request for r1."""
    name = x509.SubjectAlternativeName([x509.UniformResourceIdentifier("spiffe://testfleet/robot/r1")])
    builder = x509.CertificateSigningRequestBuilder().subject_name(x509.Name([])).add_extension(name, critical=False)
    return builder.sign(SIGNING, hashes.SHA256()).public_bytes(serialization.Encoding.DER)


def identity_file(data: bytes) -> None:
    """The robot's identity, and the key that waits."""

    def run(path: Path) -> None:
        folder = path.parent / "identity"
        folder.mkdir()
        for name in ("identity.json", "pending.json"):
            (folder / name).write_bytes(data)
            (folder / name).chmod(0o600)
        files = IdentityFiles(path.parent)
        files.pending_key("other")
        files.load()

    on_disk(data, run)


def credentials(data: bytes) -> None:
    """The user's file of keys."""

    def run(path: Path) -> None:
        before = {name: os.environ.pop(name, None) for name in ("METAROS_KEY",)} | {"HOME": os.environ.get("HOME")}
        os.environ["HOME"] = str(path.parent)
        (path.parent / ".metaros").mkdir()
        path.rename(path.parent / ".metaros" / "credentials")
        try:
            key_for("http://127.0.0.1:8080")
        finally:
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value

    on_disk(data, run)


def tokens_of(text: str) -> None:
    """An enrolment token, as either side reads it; a key."""
    parse_key(text)
    with contextlib.suppress(TokenFormatError):
        enrolment_token.parse_token(text)
    tokens.parse_token(text)


SIGNING = ec.derive_private_key(7, ec.SECP256R1())
KEY = new_key()
CA = FleetCa()
LEAF = CA.robot(KEY.public_key(), "r1")
LEAF_DER = x509.load_pem_x509_certificate(LEAF.encode()).public_bytes(serialization.Encoding.DER)
IDENTITY = {
    "robot": "r1",
    "fleet": "testfleet",
    "url": "http://127.0.0.1:1",
    "system_trust": False,
    "grpc_port": 1,
    "grpc_tls": True,
    "certificate": LEAF,
    "chain": CA.chain,
    "roots": CA.roots,
    "key": key_to_pem(KEY),
}
REQUESTS: tuple[dict[str, Any], ...] = (
    {"op": "subscribe", "id": 1, "robots": "sim_*", "topics": "**/odom", "mode": "latest", "max_rate_hz": 5},
    {"op": "subscribe_metrics", "id": 2, "robots": "*", "series": ["battery_state.*"], "max_rate_hz": 2.5},
    {"op": "subscribe_fleet", "id": 3},
    {"op": "drive", "linear": 0.5, "angular": -0.5, "seq": 7, "holder": "ada"},
)


def text_target(name: str, run: Callable[[str], Any], errors: tuple[type[Exception], ...], *seeds: str) -> Target:
    """A target that takes text."""
    return Target(
        name=name, run=lambda data: run(text_of(data)), errors=errors, seeds=tuple(seed.encode() for seed in seeds)
    )


TARGETS = (
    Target(
        name="socket request",
        run=stream_request,
        errors=(InvalidRequestError, NameError_),
        seeds=tuple(json.dumps(item).encode() for item in REQUESTS),
    ),
    Target(
        name="request body",
        run=body,
        errors=(ValidationError,),
        seeds=tuple(
            bytes([BODIES.index(model)]) + json.dumps(value).encode()
            for model, value in (
                (identity.LoginRequest, {"name": "ada", "password": "correct horse"}),
                (common.PublishRequest, {"topic": "/a", "type": "std_msgs/msg/String", "message": {"data": "x"}}),
                (enrol.EnrolRequest, {"robot": "r1", "token": "mr1.a.b.c", "csr": "x"}),
            )
        ),
    ),
    Target(
        name="json message",
        run=json_message,
        errors=(orjson.JSONDecodeError, FieldError),
        seeds=tuple(bytes([n]) + json.dumps(value).encode() for n, value in enumerate(JSON_SEEDS)),
        per_byte=1000,
    ),
    Target(
        name="credential headers",
        run=headers,
        errors=(CredentialsError,),
        seeds=(
            b"authorization: Bearer mrk_0011223344556677_" + b"0" * 64,
            b"cookie: metaros_session=abcdef; other=1\ncookie: metaros_session=abcdef",
            b"metaros.v1\nmetaros.key.mrk_0011223344556677_" + b"0" * 64,
        ),
    ),
    text_target(
        "times", times, (InvalidRequestError,), "-15m", "now", "2026-01-02T03:04:05.5+01:00", "2026-01-02", "1.5h"
    ),
    text_target(
        "cursor",
        lambda text: read_cursor(text, newest_first=False),
        (InvalidRequestError,),
        write_cursor((5, 1, 77, 9), newest_first=False),
        write_cursor((5, 1, 77, 9), newest_first=True),
    ),
    text_target(
        "names", names, (InvalidRequestError, NameError_), "sim_1", "recordings/abc-1.mcap", "**/odom", "../../etc"
    ),
    text_target(
        "token and key texts",
        tokens_of,
        (IdentityError,),
        CA.token("0123456789ab"),
        "mrk_0011223344556677_" + "0" * 64,
    ),
    Target(
        name="certificate request",
        run=csr,
        errors=(IdentityError,),
        seeds=(request_der(), as_pem(request_der(), "CERTIFICATE REQUEST").encode()),
    ),
    Target(name="certificate", run=certificate, errors=(IdentityError,), seeds=(LEAF_DER, LEAF.encode())),
    Target(
        name="roots that are shown", run=answer, errors=(PinError, EnrolAnswerError), seeds=(pem(CA.root).encode(),)
    ),
    Target(name="certificate that comes back", run=issued, errors=(EnrolAnswerError,), seeds=(LEAF.encode(),)),
    text_target("challenge", _from_base64, (EnrolAnswerError,), base64.urlsafe_b64encode(bytes(32)).decode()),
    Target(
        name="identity file",
        run=identity_file,
        errors=(IdentityFileError,),
        seeds=(json.dumps(IDENTITY).encode(), json.dumps({"purpose": "other", "key": key_to_pem(KEY)}).encode()),
        cost=10,
    ),
    Target(
        name="credentials file",
        run=credentials,
        errors=(ConfigError,),
        seeds=(b'{"gateways": {"http://127.0.0.1:8080": "mrk_x"}}',),
        cost=8,
    ),
)
