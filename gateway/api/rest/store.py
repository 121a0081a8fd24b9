"""What is stored, how fast it grows, and what the retention would delete next."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models, models_store
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of

__all__ = ["router"]

router = APIRouter(prefix="/api/v1/store", tags=["store"], default_response_class=JsonResponse)


@router.get("", responses={200: {"model": models_store.StoreAccount}, 503: {"model": models.Problem}})
async def get_store(request: Request) -> Response:
    """The account of the store; at most 10 s old."""
    return JsonResponse(await services_of(request).storage.document())


@router.get("/retention", responses={200: {"model": models_store.RetentionPlan}, 503: {"model": models.Problem}})
async def get_retention(request: Request) -> Response:
    """What the next purge would delete, and why; nothing is deleted by asking."""
    return JsonResponse(await services_of(request).storage.plan())
