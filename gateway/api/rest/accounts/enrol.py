"""Robots' identities over HTTP: enrolment and renewal for robots, tokens and revocation for people."""

from __future__ import annotations

import base64
import binascii
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission, require_visible
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.address import PROXIED_KEY
from gateway.api.middleware.audited import note
from gateway.api.models import common
from gateway.api.models import enrol as models_enrol
from gateway.api.problem import JsonResponse
from gateway.api.rest.accounts.auth import REFUSALS
from gateway.api.rest.bodies import body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.domain.host_names import url_of
from gateway.domain.identity import RobotIdentity, TokenState
from gateway.errors import IdentityError, InvalidRequestError
from gateway.identity.certificates.enrol import CHALLENGE_S, Enrolled
from gateway.settings import is_loopback

__all__ = ["router"]

router = api_router("/api/v1", tags=["identity"])


@router.get(
    "/enrol/roots",
    dependencies=[require_permission("agent.enrol")],
    responses={200: {"model": models_enrol.FleetRoots}, 503: {"model": common.Problem}},
)
async def get_roots(request: Request) -> Response:
    """The fleet's roots, for a robot that compares them with the pin in its token before it believes anything."""
    authorities = services_of(request).identities.authorities
    return JsonResponse({"fleet": authorities.fleet, "roots": authorities.roots_pem, "pins": sorted(authorities.pins)})


@router.post(
    "/enrol",
    status_code=201,
    dependencies=[require_permission("agent.enrol")],
    responses={201: {"model": models_enrol.Enrolment}, 200: {"model": models_enrol.Enrolment}, **REFUSALS},
    openapi_extra=body_document(models_enrol.EnrolRequest),
)
async def enrol(request: Request) -> Response:
    """A robot's first certificate for its token; 200 for the answer to a request that was answered before."""
    body = await read_body(request, models_enrol.EnrolRequest)
    services = services_of(request)
    given = await services.identities.enrol.enrol(body.token, body.robot, body.csr)
    await services.identities.robots.refresh()
    services.links.recheck()  # whoever spoke under this name without an identity goes now
    note(request, detail=f"robot {given.robot} enrolled")
    return JsonResponse(_enrolment(request, given), status_code=201 if given.fresh else 200)


@router.post(
    "/enrol/challenge",
    dependencies=[require_permission("agent.enrol")],
    responses={200: {"model": models_enrol.EnrolChallenge}, **REFUSALS},
    openapi_extra=body_document(models_enrol.ChallengeRequest),
)
async def get_challenge(request: Request) -> Response:
    """What a renewal has to sign; the same for every robot, known or not."""
    await read_body(request, models_enrol.ChallengeRequest)
    identities = services_of(request).identities
    nonce = await identities.enrol.challenge()
    return JsonResponse({"nonce": _base64(nonce), "audience": identities.fleet, "valid_s": CHALLENGE_S})


@router.post(
    "/enrol/renew",
    dependencies=[require_permission("agent.enrol")],
    responses={200: {"model": models_enrol.Enrolment}, **REFUSALS},
    openapi_extra=body_document(models_enrol.RenewRequest),
)
async def renew(request: Request) -> Response:
    """The next certificate for a robot that proves to hold the old one's key, up to 30 days after that one's end."""
    body = await read_body(request, models_enrol.RenewRequest)
    given = await services_of(request).identities.enrol.renew(
        body.robot,
        nonce=_bytes(body.nonce),
        certificate=body.certificate,
        csr=body.csr,
        proof=_bytes(body.proof),
    )
    note(request, detail=f"robot {given.robot} renewed")
    return JsonResponse(_enrolment(request, given))


@router.get(
    "/enrolment-tokens",
    dependencies=[require_permission("robots.enrol")],
    responses={200: {"model": models_enrol.EnrolmentTokenList}, **REFUSALS},
)
async def list_tokens(request: Request, window: Paged) -> Response:
    """The newest enrolment tokens, used and unused, of robots in one's scope."""
    principal = principal_of(request)
    found = await services_of(request).identities.enrol.tokens()
    seen = [one for one in found if principal.sees_all or principal.sees(one.robot or one.used_robot)]
    return listing("tokens", seen, _token, model=models_enrol.EnrolmentToken, key=lambda one: one.id, window=window)


@router.post(
    "/enrolment-tokens",
    status_code=201,
    dependencies=[require_permission("robots.enrol")],
    responses={201: {"model": models_enrol.NewEnrolmentToken}, **REFUSALS},
    openapi_extra=body_document(models_enrol.TokenOrder),
)
async def make_token(request: Request) -> Response:
    """Make a token that enrols one robot once. Its secret is in this answer and nowhere else."""
    body = await read_body(request, models_enrol.TokenOrder)
    principal, services = principal_of(request), services_of(request)
    if body.robot:
        require_visible(request, body.robot)
    elif not principal.sees_all:
        raise InvalidRequestError("robot: who does not see every robot has to say which one the token is for")
    token, state = await services.identities.enrol.make_token(
        robot=body.robot, made_by=principal.name, ttl_s=body.ttl_s
    )
    note(request, detail=f"token {state.id} for {body.robot or 'any robot'}")
    url = _url_for_robots(request)
    command = f"metaros agent enrol {token.text} --gateway {url}" + (f" --name {body.robot}" if body.robot else "")
    return JsonResponse({**_token(state), "token": token.text, "command": command}, status_code=201)


@router.delete(
    "/enrolment-tokens/{token_id}",
    dependencies=[require_permission("robots.enrol")],
    responses={200: {"model": common.Ok}, **REFUSALS},
)
async def drop_token(request: Request, token_id: str) -> Response:
    """Take back a token that no robot has used."""
    if not await services_of(request).identities.enrol.drop_token(token_id):
        raise IdentityError("token_unknown", f"there is no unused enrolment token {token_id[:40]!r}")
    return JsonResponse({"ok": True})


@router.get(
    "/identities",
    dependencies=[require_permission("robots.enrol")],
    responses={200: {"model": models_enrol.IdentityList}, **REFUSALS},
)
async def list_identities(request: Request, window: Paged) -> Response:
    """Every robot's identity and its certificates, of robots in one's scope."""
    principal = principal_of(request)
    found = await services_of(request).identities.robots.list()
    seen = [one for one in found if principal.sees(one.robot)]
    return listing(
        "identities", seen, _identity, model=models_enrol.RobotIdentity, key=lambda one: one.robot, window=window
    )


@router.post(
    "/robots/{robot_id}/revoke",
    dependencies=[require_permission("robots.revoke")],
    responses={200: {"model": common.Ok}, **REFUSALS},
    openapi_extra=body_document(models_enrol.RevokeRequest),
)
async def revoke(request: Request, robot_id: str) -> Response:
    """End a robot's identity: its links are cut now, on other gateways within seconds."""
    body = await read_body(request, models_enrol.RevokeRequest)
    services = services_of(request)
    await services.identities.robots.revoke(robot_id, body.reason)
    services.links.recheck()
    note(request, detail=f"robot {robot_id} revoked: {body.reason}")
    return JsonResponse({"ok": True})


def _enrolment(request: Request, given: Enrolled) -> dict[str, Any]:
    services = services_of(request)
    return {
        "robot": given.robot,
        "fleet": services.identities.fleet,
        "certificate": given.certificate,
        "chain": given.chain,
        "roots": given.roots,
        "vouchers": given.vouchers,
        "not_after": rfc3339(given.not_after_ns),
        "now": rfc3339(services.clock.wall_ns()),
        "grpc_port": services.grpc_port(),
        "grpc_tls": services.settings.robots_tls,
    }


def _url_for_robots(request: Request) -> str:
    """Where a robot finds this gateway: as the administrator did, unless that is a name of this machine for itself."""
    asked, public = request.url.hostname or "", services_of(request).settings.public_host
    if public and is_loopback(asked) and PROXIED_KEY not in request.scope:
        return url_of(request.url.scheme, public, request.url.port or 443)
    return f"{request.url.scheme}://{request.url.netloc}"


def _token(state: TokenState) -> dict[str, Any]:
    return {
        "id": state.id,
        "robot": state.robot,
        "made": rfc3339(state.made_ns),
        "made_by": state.made_by,
        "expires": rfc3339(state.expires_ns),
        "used": _moment(state.used_ns),
        "used_by": state.used_robot,
    }


def _identity(identity: RobotIdentity) -> dict[str, Any]:
    return {
        "robot": identity.robot,
        "state": "revoked" if identity.revoked_ns else "active",
        "enrolled": rfc3339(identity.enrolled_ns),
        "revoked": _moment(identity.revoked_ns),
        "reason": identity.reason,
        "alarm": identity.alarm,
        "alarm_at": _moment(identity.alarm_ns),
        "certificates": [
            {
                "serial": one.serial,
                "how": one.how,
                "issued": rfc3339(one.issued_ns),
                "not_after": rfc3339(one.not_after_ns),
                "revoked": _moment(one.revoked_ns),
            }
            for one in identity.certificates
        ],
    }


def _moment(stamp_ns: int) -> str | None:
    return rfc3339(stamp_ns) if stamp_ns else None


def _base64(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


def _bytes(text: str) -> bytes:
    try:
        return base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
    except (binascii.Error, ValueError) as error:
        raise IdentityError("proof_refused", "the challenge or the proof is not base64url") from error
