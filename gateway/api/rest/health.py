"""Is the process alive, and can it do its work."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.models import common
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of

__all__ = ["router"]

router = APIRouter(tags=["health"])


@router.get(
    "/healthz",
    dependencies=[require_permission("health.read")],
    responses={200: {"model": common.Health}},
    response_class=JsonResponse,
)
async def healthz() -> Response:
    """The process answers."""
    return JsonResponse({"status": "ok"})


@router.get(
    "/readyz",
    dependencies=[require_permission("health.read")],
    responses={200: {"model": common.Ready}, 503: {"model": common.Ready}},
    response_class=JsonResponse,
)
async def readyz(request: Request) -> Response:
    """200 when every check is ok, else 503 with what is wrong; notes say what else is, without harm to who connects."""
    services = services_of(request)
    checks = services.checks()
    ready = all(state == "ok" for state in checks.values())
    objects = services.store.objects_error
    notes = {"objects": objects} if objects is not None else {}
    body = {"status": "ready" if ready else "not ready", "checks": checks, "notes": notes}
    return JsonResponse(body, status_code=200 if ready else 503)
