"""The page that describes the API, for people."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from gateway.api.authorization import require_permission
from gateway.api.openapi.docs_page import STYLE, render_docs

__all__ = ["router"]

router = APIRouter(prefix="/docs", tags=["api"])


@router.get("", dependencies=[require_permission("api.read")], response_class=HTMLResponse)
async def get_docs(request: Request) -> Response:
    """Every operation of this API on one page, which fetches nothing from elsewhere and runs no script."""
    state = request.app.state
    page: bytes | None = getattr(state, "docs_page", None)
    if page is None:
        document = request.app.openapi()
        page = state.docs_page = (await asyncio.to_thread(render_docs, document)).encode()
    return HTMLResponse(page, headers={"Cache-Control": "no-cache"})


@router.get(
    "/style.css",
    dependencies=[require_permission("api.read")],
    response_class=Response,
    responses={200: {"content": {"text/css": {}}}},
)
async def get_docs_style() -> Response:
    """How that page looks."""
    return Response(STYLE, media_type="text/css", headers={"Cache-Control": "no-cache"})
