"""Tickets: short-lived bearers for viewers, which have no place for a key but their URL."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note, rights_detail
from gateway.api.models import identity
from gateway.api.problem import JsonResponse
from gateway.api.rest.accounts.auth import REFUSALS
from gateway.api.rest.bodies import body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.domain.principal import Role

__all__ = ["router"]

router = api_router("/api/v1/auth", tags=["accounts"])


@router.post(
    "/tickets",
    status_code=201,
    dependencies=[require_permission("tickets.make")],
    responses={201: {"model": identity.Ticket}, **REFUSALS},
    openapi_extra=body_document(identity.TicketRequest),
)
async def make_ticket(request: Request) -> Response:
    """A ticket that opens the sockets of viewers (/foxglove, /rosbridge, /api/v1/stream) as `?token=`.

    It may do no more than who asks, at any time, and ends by itself.
    """
    body = await read_body(request, identity.TicketRequest)
    principal, role = principal_of(request), Role.of(body.role)
    made = await services_of(request).tickets.make(principal, role=role, robots=body.robots, ttl_s=body.ttl_s)
    note(request, detail=rights_detail("ticket", role, body.robots or principal.robots))
    return JsonResponse({"ticket": made.text, "expires": rfc3339(made.expires_ns)}, status_code=201)
