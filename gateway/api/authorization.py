"""Authorization of every route and socket: `require_permission("noun.verb")` names a row of the permission table.

    router = APIRouter()
    @router.get("/api/v1/robots/{robot_id}", dependencies=[allow("robots.read")])

It refuses in this order, so that no answer tells more than the one before: a credential that is not good (401
`bad_credentials`, or 503 while the store cannot say), a session's mutation without its token (403 `csrf`), nobody known
(401 `sign_in`), too little role (403 `forbidden`), a robot out of scope (404, the very answer of a robot that does not
exist).
"""

from __future__ import annotations

import hmac
from collections.abc import Callable, Iterator
from typing import Any

from fastapi import APIRouter, params
from starlette.requests import HTTPConnection

from gateway.domain.principal import NOBODY, Principal
from gateway.errors import CsrfError, ForbiddenError, InvalidRequestError, RequestError, SignInError, UnknownRobotError
from gateway.identity.permissions import Permission, permission
from metaros.errors import MetarosError

__all__ = [
    "PATH_PERMISSIONS",
    "RPC_PERMISSIONS",
    "authorize",
    "permissions_of",
    "principal_of",
    "require_all_robots",
    "require_permission",
    "require_visible",
    "routes_of",
]

PRINCIPAL_KEY = "metaros.principal"  # of a scope: who asks
REFUSAL_KEY = "metaros.refusal"  # why a credential is not good
CREDENTIAL_KEY = "metaros.credential"  # what it was
RATES_KEY = "metaros.rates"  # how often somebody may ask, see rate.py
BY_COOKIE_KEY = "metaros.by_cookie"  # whether a browser sends it by itself
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

# Paths that no router of ours serves, and the RPCs: the whole rest of what answers on the gateway's ports.
PATH_PERMISSIONS: dict[str, str] = {"/api/v1/openapi.json": "api.read", "/": "page.read"}
RPC_PERMISSIONS: dict[str, str] = {
    "/metaros.v1.Link/Connect": "agent.link",
    "/metaros.v1.FleetService/ListRobots": "robots.read",
    "/metaros.v1.FleetService/GetRobot": "robots.read",
    "/metaros.v1.EventService/ListEvents": "events.read",
    "/metaros.v1.EventService/WatchEvents": "events.read",
    "/metaros.v1.TelemetryService/Subscribe": "telemetry.read",
    "/metaros.v1.TelemetryService/Query": "history.read",
    "/metaros.v1.TelemetryService/Publish": "robots.publish",
    "/metaros.v1.TelemetryService/CallService": "robots.call",
    "/metaros.v1.TelemetryService/SendGoal": "robots.call",
    "/metaros.v1.TelemetryService/WatchGoal": "robots.read",
    "/metaros.v1.TelemetryService/CancelGoal": "robots.call",
    "/metaros.v1.FleetService/SendCommand": "commands.send",
    "/metaros.v1.FleetService/GetCommand": "commands.read",
    "/metaros.v1.FleetService/WatchCommand": "commands.read",
    "/metaros.v1.FleetService/AcquireLease": "robots.drive",
    "/metaros.v1.FleetService/RenewLease": "robots.drive",
    "/metaros.v1.FleetService/ReleaseLease": "robots.drive",
    "/metaros.v1.FleetService/Drive": "robots.drive",
    "/metaros.v1.AlertService/ListAlerts": "alerts.read",
    "/metaros.v1.AlertService/CountAlerts": "alerts.read",
    "/metaros.v1.AlertService/GetAlert": "alerts.read",
    "/metaros.v1.AlertService/WatchAlerts": "alerts.read",
    "/metaros.v1.AlertService/ListSilences": "alerts.read",
    "/metaros.v1.AlertService/ListChecks": "alerts.read",
    "/metaros.v1.AlertService/ListRoutes": "alerts.read",
    "/metaros.v1.AlertService/GetLearning": "alerts.read",
    "/metaros.v1.AlertService/GetBand": "alerts.read",
    "/metaros.v1.AlertService/AcknowledgeAlert": "alerts.handle",
    "/metaros.v1.AlertService/UnacknowledgeAlert": "alerts.handle",
    "/metaros.v1.AlertService/ResolveAlert": "alerts.handle",
    "/metaros.v1.AlertService/CommentAlert": "alerts.handle",
    "/metaros.v1.AlertService/AssignAlert": "alerts.handle",
    "/metaros.v1.AlertService/AcceptAlert": "alerts.handle",
    "/metaros.v1.AlertService/SilenceAlert": "alerts.handle",
    "/metaros.v1.AlertService/ClipAlert": "alerts.handle",
    "/metaros.v1.AlertService/AddSilence": "alerts.handle",
    "/metaros.v1.AlertService/EndSilence": "alerts.handle",
    "/metaros.v1.AlertService/Backtest": "alerts.handle",
    "/metaros.v1.AlertService/SetCheck": "alerts.manage",
    "/metaros.v1.AlertService/ResetCheck": "alerts.manage",
    "/metaros.v1.AlertService/TestRoute": "alerts.manage",
    "/grpc.health.v1.Health/Check": "health.read",
    "/grpc.health.v1.Health/List": "health.read",
    "/grpc.health.v1.Health/Watch": "health.read",
    "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo": "api.read",
    "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo": "api.read",
}

_ROWS: dict[Callable[..., Any], Permission] = {}


def require_permission(name: str) -> params.Depends:
    """A FastAPI dependency that refuses whoever lacks the permission."""
    row = permission(name)

    async def check(connection: HTTPConnection) -> None:
        authorize(connection, row)

    _ROWS[check] = row
    return params.Depends(check)


def authorize(connection: HTTPConnection, row: Permission) -> None:
    """Return when the connection's principal has the permission; raise why not."""
    connection.state.asked = row
    if row.who != "anyone":
        refusal: MetarosError | None = connection.scope.get(REFUSAL_KEY)
        if refusal is not None:
            raise refusal
    principal = principal_of(connection)
    if row.who != "anyone":
        _check_token(connection, principal)
    if not row.granted(principal):
        raise _refusal(principal, row)
    if "\0" in connection.scope["path"] or b"%00" in connection.scope["query_string"]:
        raise InvalidRequestError("an address has no NUL")  # no database takes one
    robot_id = connection.path_params.get("robot_id")
    if row.robots and robot_id is not None:
        require_visible(connection, robot_id)
    if (rates := connection.scope.get(RATES_KEY)) is not None:
        rates.admit(connection, row)
    connection.state.permission = row


def principal_of(connection: HTTPConnection) -> Principal:
    """Who asks."""
    found: Principal = connection.scope.get(PRINCIPAL_KEY, NOBODY)
    return found


def require_visible(connection: HTTPConnection, robot_id: str) -> None:
    """UnknownRobotError for a robot out of the principal's scope, in the words for one that does not exist."""
    if not principal_of(connection).sees(robot_id):
        raise UnknownRobotError.of(robot_id)


def require_all_robots(connection: HTTPConnection, what: str) -> None:
    """ForbiddenError for what reaches every robot, asked by somebody who is not to reach them all."""
    if not principal_of(connection).sees_all:
        raise ForbiddenError(f"{what} are for every robot: they need somebody whose scope is all of them")


def permissions_of(route: Any) -> list[Permission]:
    """The permissions that a route declares: exactly one, or the suite fails."""
    dependant = getattr(route, "dependant", None)
    return [_ROWS[item.call] for item in dependant.dependencies if item.call in _ROWS] if dependant else []


def routes_of(routers: tuple[APIRouter, ...]) -> Iterator[tuple[str, str, list[Permission]]]:
    """Every operation and socket of some routers: method ("SOCKET" for those), path, what it declares."""
    for router in routers:
        for route in router.routes:
            for method in sorted(getattr(route, "methods", None) or ("SOCKET",)):
                yield method, str(getattr(route, "path", "")), permissions_of(route)


def _check_token(connection: HTTPConnection, principal: Principal) -> None:
    """A browser adds the cookie by itself, whoever's page asks; the token only our own page can add."""
    scope = connection.scope
    if scope["type"] != "http" or scope["method"] in SAFE_METHODS or not scope.get(BY_COOKIE_KEY):
        return
    said = connection.headers.get("x-csrf-token", "")
    if not principal.csrf or not hmac.compare_digest(said.encode(), principal.csrf.encode()):
        raise CsrfError("a session's request that changes something carries its token in X-CSRF-Token")


def _refusal(principal: Principal, row: Permission) -> RequestError:
    if principal.kind == "anonymous":
        return SignInError(f"{row.name} needs somebody who has signed in, or a key in Authorization: Bearer")
    need = f"the role {row.least.word} or more" if row.who == "people" else "a robot's own identity"
    return ForbiddenError(f"{row.name} needs {need}; {principal.name or principal.id} has {principal.role.word}")
