"""The gateway itself: its name, its version, and where else it listens."""

from __future__ import annotations

from importlib.metadata import version

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models.gateway import GatewayState
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of

__all__ = ["router"]

router = api_router("/api/v1/gateway", tags=["gateway"])


@router.get("", dependencies=[require_permission("self.read")], responses={200: {"model": GatewayState}})
async def get_gateway(request: Request) -> Response:
    """What a client has to know that has only the gateway's address."""
    services = services_of(request)
    return JsonResponse(
        {
            "gateway": services.store.gateway_id,
            "version": version("metaros"),
            "robots_port": services.grpc_port(),
            "programs_port": services.programs_port(),
        }
    )
