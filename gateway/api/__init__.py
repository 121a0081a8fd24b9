"""The gateway's doors for people and programs: REST, WebSocket and the dashboard's files."""

from __future__ import annotations

from collections.abc import Iterator

from fastapi import APIRouter, FastAPI
from starlette.types import ASGIApp

from gateway.api.address import Proxies
from gateway.api.audited import Audited
from gateway.api.authenticate import Authenticate
from gateway.api.aws import routes as aws
from gateway.api.aws.shaped import Shaped
from gateway.api.aws.signed import Signed
from gateway.api.bodies import Bodies
from gateway.api.conditional import Conditional
from gateway.api.express import Express
from gateway.api.foxglove import socket as foxglove
from gateway.api.guard import Guard
from gateway.api.measured import Measured
from gateway.api.openapi import describe_permissions
from gateway.api.problem import install_problems
from gateway.api.rate import RateLimited
from gateway.api.refused_sign_in import RefusedSignIn
from gateway.api.rest import (
    alert_checks,
    alert_routes,
    alerts,
    audit,
    auth,
    backtests,
    commands,
    dead_letters,
    docs,
    enrol,
    events,
    export,
    fleet,
    function_calls,
    function_code,
    functions,
    gateway,
    goals,
    graph,
    happenings,
    health,
    history,
    hooks,
    keys,
    metrics,
    node_values,
    nodes,
    oidc,
    ops,
    orders,
    recordings,
    replays,
    robots,
    rollouts,
    rules,
    services,
    silences,
    store,
    templates,
    tickets,
    twin,
    types,
    updates,
    uplink,
    users,
    watch,
)
from gateway.api.robot_rows import make_robot_rows
from gateway.api.rosbridge import socket as rosbridge
from gateway.api.services import Services
from gateway.api.static import Dashboard
from gateway.api.viewer_doors import QueryToken
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
    happenings.router,
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
        title="Meta-ROS gateway", version="1", routes=routes, openapi_url=OPENAPI, docs_url=None, redoc_url=None
    )
    app.state.services = services
    app.state.robot_rows = make_robot_rows(services)
    install_problems(app)
    app.add_middleware(Express, routes=robots.EXPRESS)
    describe_permissions(app, ROUTERS)
    app.mount("/", Dashboard(services.settings.static_dir))
    settings = services.settings
    limited = RateLimited(Bodies(Conditional(app)), services.rates)
    logged = Audited(limited, services.audit)
    known = Authenticate(
        logged, services.door, anonymous=settings.anonymous_viewers, host=settings.host, rates=services.rates
    )
    folder = settings.data_dir / "functions" / "code" / "incoming"
    signed = Signed(RefusedSignIn(known), services.accounts, services.rates, folder, clock=services.clock)
    guarded = Guard(signed, hosts=settings.server_names, origins=settings.allow_origins)
    measured = Measured(Shaped(guarded), services.operations.meters, clock=services.clock)
    return QueryToken(Proxies(measured, settings.proxies, only=settings.proxied_only))


def route_paths() -> list[str]:
    """Every path of the API, sockets included."""
    return [OPENAPI, *_paths()]


def _paths() -> Iterator[str]:
    for router in ROUTERS:
        for route in router.routes:
            yield str(getattr(route, "path", "")).replace(":path}", "}")  # as OpenAPI and the docs write it
