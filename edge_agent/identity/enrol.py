"""Enrolment and renewal: a key and a CSR go to the gateway's HTTP API, a certificate comes back and is kept.

Both may be broken off anywhere and made again: the key that was sent waits on disk, and the gateway answers the same
key with the same certificate.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from edge_agent.errors import EnrolAnswerError, EnrolRefusedError, PinError, UntrustedError
from edge_agent.identity.certificate import check_issued, vouched_roots
from edge_agent.identity.csr import csr_der, csr_pem, make_csr
from edge_agent.identity.enrolment_token import Token, pinned_roots
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.gateway_http import GatewayHttpClient, check_url, unverified, verified
from edge_agent.identity.key import PrivateKey, key_to_pem
from metaros.link.proof import renew_statement, sign

__all__ = ["enrol", "renew"]

# Codes after which the key that waits is of no use any more.
FINAL = frozenset({"token_unknown", "token_used", "token_expired", "token_foreign", "csr_refused"})


def enrol(token: Token, *, url: str, robot_id: str, state_dir: Path) -> RobotIdentity:
    """Turn a token into an identity in the state directory. Blocks for some seconds at most.

    A token that has brought the identity there is not used again: what it brought is returned.

    Raises:
        PinError: another gateway than the token's answers at the URL.
        EnrolError: the gateway cannot be reached, is not to be trusted or refuses; nothing of the robot has changed.
        InsecureGatewayError, ConfigError: the URL.
        IdentityFileError: the state directory.
    """
    url, files = check_url(url), IdentityFiles(state_dir)
    if (held := files.brought_by(token.text)) is not None and held.robot == robot_id:
        return held
    shown = GatewayHttpClient(url, unverified()).get("/enrol/roots")
    fleet = _text(shown, "fleet")
    roots = pinned_roots(_text(shown, "roots", empty=True).encode(), token.pin).decode()  # none: it gave no token yet
    key = files.pending_key(f"token {token.id} {robot_id}")
    request = csr_pem(make_csr(key, fleet=fleet, robot_id=robot_id))
    body = {"token": token.text, "robot": robot_id, "csr": request}
    try:
        try:
            answer, system_trust = GatewayHttpClient(url, verified(roots)).post("/enrol", body), False
        except UntrustedError as error:
            answer, system_trust = _by_system(url, roots, body, error), True
    except EnrolRefusedError as error:
        if error.reason in FINAL:
            files.forget_pending()
        raise
    identity = _identity(answer, key, url=url, fleet=fleet, robot_id=robot_id, roots=roots, system_trust=system_trust)
    files.save(identity, token=token.text)
    return identity


def renew(identity: RobotIdentity, state_dir: Path) -> RobotIdentity:
    """The next certificate, with a new key, on the word of the present one. Blocks; raises as `enrol` does."""
    client = GatewayHttpClient(identity.url, verified(identity.roots, system=identity.system_trust))
    asked = client.post("/enrol/challenge", {"robot": identity.robot})
    if asked.get("audience", identity.fleet) != identity.fleet:
        raise PinError(f"the gateway is of the fleet {asked.get('audience')!r}, this robot of {identity.fleet!r}")
    files = IdentityFiles(state_dir)
    key = files.pending_key(f"renew {hashlib.sha256(identity.certificate.encode()).hexdigest()}", renewal=True)
    request = make_csr(key, fleet=identity.fleet, robot_id=identity.robot)
    try:
        statement = renew_statement(
            _from_base64(_text(asked, "nonce")),
            audience=identity.fleet,
            robot_id=identity.robot,
            csr_der=csr_der(request),
        )
    except ValueError as error:
        raise EnrolAnswerError(f"the gateway's challenge is none: {error}") from error
    body = {
        "robot": identity.robot,
        "nonce": asked["nonce"],
        "certificate": identity.certificate,
        "csr": csr_pem(request),
        "proof": base64.urlsafe_b64encode(sign(identity.private_key(), statement)).rstrip(b"=").decode(),
    }
    answer = client.post("/enrol/renew", body)
    fresh = _identity(
        answer,
        key,
        url=identity.url,
        fleet=identity.fleet,
        robot_id=identity.robot,
        roots=identity.roots,
        system_trust=identity.system_trust,
    )
    files.save(fresh)
    return fresh


def _by_system(url: str, roots: str, body: dict[str, Any], first: UntrustedError) -> dict[str, Any]:
    """A proxy with a certificate of its own stands before the gateway."""
    try:
        return GatewayHttpClient(url, verified(roots, system=True)).post("/enrol", body)
    except UntrustedError:
        raise UntrustedError(f"{first}; neither the fleet's root nor this system's authorities vouch for it") from None


def _identity(
    answer: dict[str, Any],
    key: PrivateKey,
    *,
    url: str,
    fleet: str,
    robot_id: str,
    roots: str,
    system_trust: bool,
) -> RobotIdentity:
    """The answer, checked: it leads to a root that was trusted before it came, whatever roots it brings along."""
    identity = RobotIdentity(
        robot=_text(answer, "robot"),
        fleet=_text(answer, "fleet"),
        url=url,
        system_trust=system_trust,
        grpc_port=_port(answer),
        grpc_tls=answer.get("grpc_tls") is True,
        certificate=_text(answer, "certificate"),
        chain=_text(answer, "chain", empty=True),
        roots=roots,
        key=key_to_pem(key),
    )
    if (identity.robot, identity.fleet) != (robot_id, fleet):
        raise EnrolAnswerError(f"the gateway's answer is for {identity.robot} of {identity.fleet}, not for {robot_id}")
    check_issued(identity.certificate, identity.chain, roots, key=key, fleet=fleet, robot_id=robot_id)
    return replace(identity, roots=_with_new_roots(answer, identity, key))


def _with_new_roots(answer: dict[str, Any], identity: RobotIdentity, key: PrivateKey) -> str:
    """The roots from now on: those the gateway names, as long as the certificate leads to one of them, too.

    They come over a channel that the old roots vouched for; so a fleet passes from one root to the next by a renewal.
    Where somebody else ends TLS the channel says nothing, and a new root needs the signature of one that is trusted.
    """
    named, vouchers = answer.get("roots"), answer.get("vouchers", "")
    if not isinstance(named, str) or not isinstance(vouchers, str):
        return identity.roots
    if identity.system_trust:
        named = vouched_roots(identity.roots, named, vouchers)
        if not named:
            return identity.roots
    check_issued(identity.certificate, identity.chain, named, key=key, fleet=identity.fleet, robot_id=identity.robot)
    return named


def _text(table: dict[str, Any], name: str, *, empty: bool = False) -> str:
    value = table.get(name)
    if not isinstance(value, str) or not (value or empty):
        raise EnrolAnswerError(f"the gateway's answer has no {name}")
    return value


def _port(table: dict[str, Any]) -> int:
    value = table.get("grpc_port", 0)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 65535:
        raise EnrolAnswerError("the gateway's answer has a grpc_port that is none")
    return value


def _from_base64(text: str) -> bytes:
    try:
        return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
    except (ValueError, binascii.Error) as error:
        raise EnrolAnswerError("the gateway's challenge is no base64") from error
