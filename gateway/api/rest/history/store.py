"""What is stored, how fast it grows, and what the retention would delete next."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models import common, store
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of

__all__ = ["router"]

BY_ROBOT = ("robots", "damaged")

router = api_router("/api/v1/store", tags=["store"])


@router.get(
    "",
    dependencies=[require_permission("store.read")],
    responses={200: {"model": store.StoreAccount}, 503: {"model": common.Problem}},
)
async def get_store(request: Request) -> Response:
    """The account of the store; at most 10 s old. Robots out of scope are in its sums only."""
    document, principal = await services_of(request).storage.document(), principal_of(request)
    if not principal.sees_all:
        mine = {name: [item for item in document[name] if principal.sees(item["robot"] or "")] for name in BY_ROBOT}
        document = {**document, **mine}
    return JsonResponse(document)


@router.get(
    "/retention",
    dependencies=[require_permission("store.read")],
    responses={200: {"model": store.RetentionPlan}, 503: {"model": common.Problem}},
)
async def get_retention(request: Request) -> Response:
    """What the next purge would delete, and why; nothing is deleted by asking."""
    return JsonResponse(await services_of(request).storage.plan())
