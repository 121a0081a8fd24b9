"""The gateway's APIs for people and programs: REST, WebSocket, AWS Lambda, Foxglove, rosbridge, the dashboard."""

from __future__ import annotations

from collections.abc import Iterator

from fastapi import APIRouter, FastAPI
from starlette.types import ASGIApp

from gateway.api.aws import routes as aws
from gateway.api.aws.shaped import Shaped
from gateway.api.aws.signed import Signed
from gateway.api.foxglove import socket as foxglove
from gateway.api.middleware.address import Proxies
from gateway.api.middleware.audited import Audited
from gateway.api.middleware.authenticate import Authenticate
from gateway.api.middleware.bodies import Bodies
from gateway.api.middleware.conditional import Conditional
from gateway.api.middleware.fast_path import FastPath
from gateway.api.middleware.guard import Guard
from gateway.api.middleware.measured import Measured
from gateway.api.middleware.rate import RateLimited
from gateway.api.middleware.refused_sign_in import RefusedSignIn
from gateway.api.middleware.static import Dashboard
from gateway.api.openapi.permissions import describe_permissions
from gateway.api.problem import install_problems
from gateway.api.rest import docs, gateway, health, ops
from gateway.api.rest.accounts import audit, auth, enrol, keys, oidc, tickets, users
from gateway.api.rest.alerting import alert_checks, alert_routes, alerts, backtests, silences, watch
from gateway.api.rest.automation import (
    dead_letters,
    events,
    function_calls,
    function_code,
    functions,
    gateway_events,
    hooks,
    replays,
    rules,
)
from gateway.api.rest.fleet import (
    commands,
    fleet,
    goals,
    graph,
    node_values,
    nodes,
    orders,
    robots,
    rollouts,
    services,
    templates,
    twin,
    types,
    updates,
    uplink,
)
from gateway.api.rest.history import export, history, metrics, recordings, store
from gateway.api.robot_rows import make_robot_rows
from gateway.api.rosbridge import socket as rosbridge
from gateway.api.services import Services
from gateway.api.viewer_endpoints import QueryToken
from gateway.api.ws import link, stream, talk, teleop

__all__ = ["ROUTERS", "create_api", "route_paths"]

ROUTERS: tuple[APIRouter, ...] = (
    aws.router,
    health.router,
    docs.router,
    gateway.router,
    robots.router,
    types.router,
    events.router,
    fleet.router,
    metrics.router,
    commands.router,
    graph.router,
    services.router,
    goals.router,
    orders.router,
    uplink.router,
    twin.router,
    node_values.router,
    nodes.router,
    templates.router,
    updates.router,
    rollouts.router,
    history.router,
    export.router,
    recordings.router,
    alerts.router,
    silences.router,
    alert_checks.router,
    alert_routes.router,
    watch.router,
    backtests.router,
    rules.router,
    hooks.router,
    gateway_events.router,
    functions.router,
    function_calls.router,
    function_code.router,
    dead_letters.router,
    replays.router,
    store.router,
    auth.router,
    users.router,
    keys.router,
    tickets.router,
    enrol.router,
    oidc.router,
    audit.router,
    ops.router,
    stream.router,
    talk.router,
    teleop.router,
    foxglove.router,
    link.router,
    rosbridge.router,
)
OPENAPI = "/api/v1/openapi.json"


def create_api(services: Services) -> ASGIApp:
    """The whole ASGI application, behind its guard."""
    # As they are: `include_router` makes each anew, models and all, which takes the first request half a second.
    routes = [route for router in ROUTERS for route in router.routes]
    app = FastAPI(
        title="Meta-ROS gateway",
        version="1",
        routes=routes,
        openapi_url=OPENAPI,
        docs_url=None,
        redoc_url=None,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # Measured and our traces are
    )
    app.state.services = services
    app.state.robot_rows = make_robot_rows(services)
    install_problems(app)
    app.add_middleware(FastPath, routes=robots.FAST_PATHS, trees=aws.CALLS)
    describe_permissions(app, ROUTERS)
    app.mount("/", Dashboard(services.settings.static_dir))
    settings = services.settings
    limited = RateLimited(Bodies(Conditional(app)), services.rates)
    logged = Audited(limited, services.audit)
    known = Authenticate(
        logged, services.authenticator, anonymous=settings.anonymous_viewers, host=settings.host, rates=services.rates
    )
    folder = settings.data_dir / "functions" / "code" / "incoming"
    signed = Signed(RefusedSignIn(known), services.accounts, services.rates, folder, clock=services.clock)
    guarded = Guard(signed, hosts=settings.server_names, origins=settings.allow_origins)
    measured = Measured(Shaped(guarded), services.meters, clock=services.clock)
    return QueryToken(Proxies(measured, settings.proxies, only=settings.proxied_only))


def route_paths() -> list[str]:
    """Every path of the API, sockets included."""
    return [OPENAPI, *_paths()]


def _paths() -> Iterator[str]:
    for router in ROUTERS:
        for route in router.routes:
            yield str(getattr(route, "path", "")).replace(":path}", "}")  # as OpenAPI and the docs write it
