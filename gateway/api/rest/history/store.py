"""What is stored, how fast it grows, and what the retention would delete next."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models, models_store
from gateway.api.allow import allow, principal_of
from gateway.api.later_route import api_router
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of

__all__ = ["router"]

BY_ROBOT = ("robots", "damaged")

router = api_router("/api/v1/store", tags=["store"])


@router.get(
    "",
    dependencies=[allow("store.read")],
    responses={200: {"model": models_store.StoreAccount}, 503: {"model": models.Problem}},
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
    dependencies=[allow("store.read")],
    responses={200: {"model": models_store.RetentionPlan}, 503: {"model": models.Problem}},
)
async def get_retention(request: Request) -> Response:
    """What the next purge would delete, and why; nothing is deleted by asking."""
    return JsonResponse(await services_of(request).storage.plan())
