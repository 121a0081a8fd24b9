"""The audit log, by page, and its proof."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.models import audit, common
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.store.accounts.audit import AuditRow

__all__ = ["router"]

MAX_ROWS = 1000
MAX_NUMBER = (1 << 63) - 1
Before = Annotated[int | None, Query(ge=1, le=MAX_NUMBER)]
Exact = Annotated[str, Query(max_length=128)]

router = api_router("/api/v1/audit", tags=["audit"])


@router.get(
    "",
    dependencies=[require_permission("audit.read")],
    responses={200: {"model": audit.AuditPage}, 503: {"model": common.Problem}},
)
async def list_audit(
    request: Request,
    before: Before = None,
    limit: Annotated[int, Query(ge=1, le=MAX_ROWS)] = 100,
    action: Exact = "",
    name: Exact = "",
    fields: FieldsText = "",
) -> Response:
    """Rows, the newest first; only those of one action (a permission's name), or of one name."""
    wanted = {"action": _text(action), "name": _text(name)}
    rows = await services_of(request).audit.page(before=before, limit=limit, **wanted)
    following = rows[-1].number if len(rows) == limit else None
    chosen = read_fields(fields, audit.AuditRow)
    return JsonResponse({"rows": [chosen.of(_view(row)) for row in rows], "next": following})


@router.get(
    "/verify",
    dependencies=[require_permission("audit.read")],
    responses={200: {"model": audit.AuditProof}, 429: {"model": common.Problem}, 503: {"model": common.Problem}},
)
async def verify_audit(request: Request) -> Response:
    """Prove the whole chain, and compare the heads in the object store. One proof at a time; it reads every row."""
    return JsonResponse(await services_of(request).audit.verify())


def _text(text: str) -> str:
    """What a column can hold: no database takes a NUL, nor half a character."""
    return text.replace("\0", "\ufffd").encode("utf-8", "replace").decode()


def _view(row: AuditRow) -> dict[str, Any]:
    event = asdict(row.event)
    try:
        at = rfc3339(event.pop("at_ns"))
    except (ValueError, OverflowError, OSError, TypeError):  # somebody has changed it: the page must show the rest
        at = ""
    return {"number": row.number, "at": at, **event, "hash": row.hash}
