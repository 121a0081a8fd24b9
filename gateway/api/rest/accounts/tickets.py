"""Tickets: short-lived bearers for viewers, which have no place for a key but their URL."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models_tickets
from gateway.api.allow import allow, principal_of
from gateway.api.audited import note, reach
from gateway.api.later_route import api_router
from gateway.api.problem import JsonResponse
from gateway.api.rest.auth import REFUSALS
from gateway.api.rest.bodies import body_document, read_body
from gateway.api.services import services_of
from gateway.api.views import rfc3339
from gateway.domain.principal import Role

__all__ = ["router"]

router = api_router("/api/v1/auth", tags=["accounts"])


@router.post(
    "/tickets",
    status_code=201,
    dependencies=[allow("tickets.make")],
    responses={201: {"model": models_tickets.Ticket}, **REFUSALS},
    openapi_extra=body_document(models_tickets.TicketRequest),
)
async def make_ticket(request: Request) -> Response:
    """A ticket that opens the sockets of viewers (/foxglove, /rosbridge, /api/v1/stream) as `?token=`.

    It may do no more than who asks, at any time, and ends by itself.
    """
    body = await read_body(request, models_tickets.TicketRequest)
    principal, role = principal_of(request), Role.of(body.role)
    made = await services_of(request).tickets.make(principal, role=role, robots=body.robots, ttl_s=body.ttl_s)
    note(request, detail=reach("ticket", role, body.robots or principal.robots))
    return JsonResponse({"ticket": made.text, "expires": rfc3339(made.expires_ns)}, status_code=201)
