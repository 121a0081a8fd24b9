"""Backtests: what would have fired over stored history, with checks of one's choice."""

from __future__ import annotations

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from gateway.alerting.backtest import BacktestRequest
from gateway.api.authorization import require_permission, require_visible
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import watch
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.ranges import parse_range
from gateway.api.services import services_of
from gateway.api.views.backtest import backtest_view

__all__ = ["router"]

router = api_router("/api/v1/backtests", tags=["alerts"])


@router.post(
    "",
    dependencies=[require_permission("alerts.handle")],
    responses={200: {"model": watch.Backtest}, **PROBLEMS},
    openapi_extra=body_document(watch.BacktestRequest),
)
async def run_backtest(request: Request) -> Response:
    """Judge a robot's stored rows again, beside what is judged now; nothing is changed. One at a time."""
    body = await read_body(request, watch.BacktestRequest)
    services = services_of(request)
    require_visible(request, body.robot)
    services.registry.get(body.robot)
    start_ns, end_ns = parse_range(body.from_, body.to, now_ns=services.clock.wall_ns())
    report = await services.backtests.run(
        BacktestRequest(
            robot=body.robot,
            series=tuple(body.series),
            start_ns=start_ns,
            end_ns=end_ns,
            checks={name: change.said() for name, change in body.checks.items()},
            detectors=tuple(body.detectors),
        )
    )
    note(request, detail=f"{body.robot}: {report.samples} samples, {len(report.findings)} findings")
    return JsonResponse(await asyncio.to_thread(backtest_view, report))
