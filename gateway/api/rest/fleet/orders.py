"""Commands that are kept: send one, or one to each robot of a selector; the history; taking one back."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.middleware.audited import note
from gateway.api.models import common
from gateway.api.models.commands import Command, CommandList, CommandRequest, FleetCommandRequest, FleetCommands, State
from gateway.api.problem import JsonResponse, error_code
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import Services, services_of
from gateway.api.views.robots import rfc3339
from gateway.domain.errors import UnknownCommandError
from gateway.domain.fleet import command as domain
from gateway.domain.fleet.selector import Selector
from gateway.domain.principal import Principal
from gateway.errors import ForbiddenError, StoreError, TooManyError
from gateway.fleet.command_manager import NewCommand
from gateway.fleet.kinds import kind_of
from gateway.identity.permissions import permission
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["check_kind", "command_view", "router", "seen_command"]

MAX_LISTED = 1000
MAX_LOOKS = 8  # at the store, for one page: of a history of which somebody may see little
MAX_FLEET = 10_000
Wait = Annotated[float, Query(ge=0, le=LIMITS.command_wait_s, description="for the command's end")]

router = api_router("/api/v1", tags=["commands"])


@router.post(
    "/robots/{robot_id}/commands",
    dependencies=[require_permission("commands.send")],
    responses={200: {"model": Command}, 202: {"model": Command}, **PROBLEMS},
    openapi_extra=body_document(CommandRequest),
)
async def send_command(request: Request, robot_id: str, wait_s: Wait = 0.0) -> Response:
    """Have a robot do something. 200 when the command is over, however it ended; 202 while it is not.

    With the header `Idempotency-Key` the same request is the same command, however often it is sent.
    """
    body = await read_body(request, CommandRequest)
    services, principal = services_of(request), principal_of(request)
    check_kind(body.kind, principal)
    order = _order(robot_id, body, request.headers.get("idempotency-key"))
    command = await services.command_manager.send(order, principal)
    note(request, detail=f"{command.id} {command.kind} {command.state}")
    if wait_s and not command.over:
        command = await services.command_manager.wait(command.id, wait_s)
    headers = {"location": f"/api/v1/commands/{command.id}"}
    return JsonResponse(command_view(command), status_code=200 if command.over else 202, headers=headers)


@router.post(
    "/commands",
    dependencies=[require_permission("commands.send")],
    responses={200: {"model": FleetCommands}, **PROBLEMS},
    openapi_extra=body_document(FleetCommandRequest),
)
async def send_fleet_command(request: Request) -> Response:
    """Have every robot that a selector names do something: one command each, durable or not."""
    body = await read_body(request, FleetCommandRequest)
    services, principal = services_of(request), principal_of(request)
    check_kind(body.kind, principal)
    robots = named(services, principal, body.selector)
    note(request, detail=f"{body.kind} to {len(robots)} robots: {body.selector[:100]}")
    key = request.headers.get("idempotency-key")
    turns, until_s = asyncio.Semaphore(LIMITS.group_at_once), services.clock.monotonic_s() + LIMITS.group_s

    async def one(robot: str) -> domain.Command | MetarosError:
        async with turns:
            try:
                if not body.durable and services.clock.monotonic_s() >= until_s:
                    raise TooManyError(f"robot {robot}'s turn did not come within {LIMITS.group_s:g} s")
                services.rates.take("robot", robot)
                order = _order(robot, body, None if key is None else f"{key} {robot}")
                return await services.command_manager.send(order, principal)
            except StoreError:
                raise
            except MetarosError as error:
                return error

    asked = [] if body.dry_run else robots
    answers = dict(zip(asked, await asyncio.gather(*map(one, asked)), strict=True))
    return JsonResponse(
        {
            "commands": [command_view(item) for item in answers.values() if isinstance(item, domain.Command)],
            "refused": {
                robot: {"code": error_code(item), "message": str(item)}
                for robot, item in answers.items()
                if isinstance(item, MetarosError)
            },
            "robots": robots,
        }
    )


@router.get(
    "/commands",
    dependencies=[require_permission("commands.read")],
    responses={200: {"model": CommandList}},
)
async def list_commands(
    request: Request,
    robot: Annotated[str, Query(description="only this robot's", max_length=64)] = "",
    state: Annotated[State | None, Query(description="only those in it")] = None,
    issuer: Annotated[str, Query(description="only those that this user or key sent", max_length=200)] = "",
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Annotated[str, Query(description="the `next` of the page before", max_length=64)] = "",
    fields: FieldsText = "",
) -> Response:
    """The newest commands, newest first."""
    filters = {"robot": robot, "state": state or "", "issuer": issuer}
    page, following = await _seen(request, filters, limit=limit, before=before)
    chosen = read_fields(fields, Command)
    return JsonResponse({"commands": [chosen.of(command_view(item)) for item in page], "next": following})


@router.get(
    "/commands/{command_id}",
    dependencies=[require_permission("commands.read")],
    responses={200: {"model": Command}, 404: {"model": common.Problem}},
)
async def get_command(request: Request, command_id: str, wait_s: Wait = 0.0) -> Response:
    """One command, and how far it is."""
    services = services_of(request)
    command = await seen_command(services, principal_of(request), command_id)
    if wait_s and not command.over:
        command = await services.command_manager.wait(command_id, wait_s)
    return JsonResponse(command_view(command))


@router.delete(
    "/commands/{command_id}",
    dependencies=[require_permission("commands.cancel")],
    responses={200: {"model": Command}, **PROBLEMS},
)
async def cancel_command(request: Request, command_id: str) -> Response:
    """Take back a durable command that has not left for its robot."""
    services = services_of(request)
    await seen_command(services, principal_of(request), command_id)
    return JsonResponse(command_view(await services.command_manager.cancel(command_id)))


def check_kind(kind: str, principal: Principal) -> None:
    """ForbiddenError unless the principal may do what that kind of command does."""
    row = permission(kind_of(kind).permission)
    if not row.granted(principal):
        raise ForbiddenError(f"{row.name} needs the role {row.least.word} or more; this has {principal.role.word}")


async def seen_command(services: Services, principal: Principal, command_id: str) -> domain.Command:
    """One command; UnknownCommandError also where its robot is out of scope."""
    found = await services.command_manager.get(command_id)
    if not principal.sees(found.robot):
        raise UnknownCommandError.of(command_id)
    return found


def named(services: Services, principal: Principal, text: str) -> list[str]:
    """The robots in scope that a selector names, by id; SelectorError for a text that is none."""
    selector = Selector.parse(text)
    known = [record.robot.id for record in services.registry.all()]
    labels = services.twins.labels_of
    return [robot for robot in known if principal.sees(robot) and selector.matches(robot, labels(robot))][:MAX_FLEET]


def command_view(item: domain.Command) -> dict[str, Any]:
    """A command as the API shows it."""

    def moment(stamp_ns: int) -> str | None:
        return rfc3339(stamp_ns) if stamp_ns else None

    return {
        "id": item.id,
        "robot": item.robot,
        "kind": item.kind,
        "request": orjson.loads(item.request),
        "state": item.state,
        "durable": item.durable,
        "issued_by": item.issued_by,
        "idempotency_key": item.idempotency,
        "timeout_s": item.timeout_ms / 1000,
        "issued": rfc3339(item.issued_ns),
        "expires": moment(item.expires_ns),
        "delivered": moment(item.delivered_ns),
        "running": moment(item.running_ns),
        "ended": moment(item.ended_ns),
        "code": item.code,
        "message": item.message,
        "result": orjson.loads(item.result) if item.result else None,
    }


def _order(robot: str, body: CommandRequest, key: str | None) -> NewCommand:
    return NewCommand(
        robot=robot,
        kind=body.kind,
        request=body.request,
        durable=body.durable,
        expires_s=body.expires_s,
        timeout_s=body.timeout_s,
        idempotency=key,
        sent_ns=body.sent_ns,
    )


async def _seen(
    request: Request, filters: dict[str, str], *, limit: int, before: str
) -> tuple[list[domain.Command], str | None]:
    """A page of commands to robots in scope, and where the next one begins.

    A page ends where it is as large, or as much was looked through, as one answer may: it may be short, or empty, and
    yet have a next one.
    """
    manager, principal = services_of(request).command_manager, principal_of(request)
    if any("\0" in value for value in (*filters.values(), before)):
        return [], None
    kept: list[domain.Command] = []
    room = LIMITS.command_page_bytes
    for _ in range(MAX_LOOKS):
        most = limit + 1 - len(kept) if principal.sees_all else MAX_LISTED
        found = await manager.list(**filters, before=before, limit=most)
        for item in found:
            if principal.sees(item.robot):
                room -= len(item.request) + len(item.result)
                if len(kept) == limit or (kept and room < 0):
                    return kept, before
                kept.append(item)
            before = item.id
        if not found:
            return kept, None
    return kept, before
