"""Dead letters: what the queue could not deliver, looked at, delivered again, or dropped."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import dead_letters as m
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.functions import dead_letter_view
from gateway.domain.automation.delivery import DEAD, DeadFilter, Delivery
from gateway.domain.errors import UnknownDeadLetterError
from gateway.errors import InvalidRequestError

__all__ = ["router"]

MAX_LISTED = 1000
PAYLOAD_BYTES = 16 * 1024
Kind = Annotated[str, Query(max_length=64, description="only of this kind: function, webhook, command …")]
Target = Annotated[str, Query(max_length=256, description="only for this target: a function, or RULE/TARGET")]
Before = Annotated[str, Query(max_length=64, description="the `next` of the page before")]
Ids = Annotated[list[Annotated[str, Query(max_length=64)]] | None, Query(max_length=1000, alias="id")]

router = api_router("/api/v1/dead-letters", tags=["dead letters"])


@router.get(
    "", dependencies=[require_permission("dead_letters.read")], responses={200: {"model": m.DeadLetterList}, **PROBLEMS}
)
async def list_dead_letters(
    request: Request,
    kind: Kind = "",
    target: Target = "",
    code: Annotated[str, Query(max_length=64)] = "",
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Before = "",
) -> Response:
    """The newest dead letters, newest first; of robots out of scope there are none."""
    queue = services_of(request).queue
    wanted = DeadFilter(kind=kind, target=target, code=code, robots=_robots(request))
    found = await queue.dead_page(wanted, before=_place(before), limit=limit + 1)
    page = [dead_letter_view(item) for item in found[:limit]]
    last = found[limit - 1] if len(found) > limit else None
    total = (await queue.status()).totals.dead.rows if principal_of(request).sees_all else len(page)
    following = f"{last.ended_ns}.{last.id}" if last is not None else None
    return JsonResponse({"dead_letters": page, "total": total, "next": following})


@router.get(
    "/{letter_id}",
    dependencies=[require_permission("dead_letters.read")],
    responses={200: {"model": m.DeadLetter}, **PROBLEMS},
)
async def get_dead_letter(request: Request, letter_id: str) -> Response:
    """One, with what its target would have got."""
    return JsonResponse(dead_letter_view(await _seen(request, letter_id), payload_bytes=PAYLOAD_BYTES))


@router.post(
    "/redrive",
    dependencies=[require_permission("dead_letters.write")],
    responses={200: {"model": m.Redriven}, **PROBLEMS},
    openapi_extra=body_document(m.Redrive),
)
async def redrive(request: Request) -> Response:
    """Deliver dead letters again, as if they had just been accepted."""
    body = await read_body(request, m.Redrive)
    wanted = _chosen(request, body.ids, body.kind, body.target, everything=body.all)
    count = await services_of(request).queue.redrive(wanted)
    note(request, detail=f"{count} of {_words(body.ids, body.kind, body.target)}")
    return JsonResponse({"redriven": count})


@router.delete(
    "", dependencies=[require_permission("dead_letters.write")], responses={200: {"model": m.Dropped}, **PROBLEMS}
)
async def drop_dead_letters(
    request: Request,
    ids: Ids = None,
    kind: Kind = "",
    target: Target = "",
    all: Annotated[bool, Query(description="every one")] = False,  # noqa: A002 - the query's own name
) -> Response:
    """Drop dead letters for good."""
    wanted = _chosen(request, ids or [], kind, target, everything=all)
    count = await services_of(request).queue.drop_dead(wanted)
    note(request, detail=f"{count} of {_words(ids or [], kind, target)}")
    return JsonResponse({"dropped": count})


def _chosen(request: Request, ids: list[str], kind: str, target: str, *, everything: bool) -> DeadFilter:
    if not (ids or kind or target or everything):
        raise InvalidRequestError("say which: ids, a kind, a target, or all")
    return DeadFilter(ids=tuple(ids), kind=kind, target=target, robots=_robots(request))


def _robots(request: Request) -> frozenset[str] | None:
    """Whose dead letters somebody may know of; None: all, those about no robot too."""
    principal = principal_of(request)
    if principal.sees_all:
        return None
    known = services_of(request).registry.all()
    return frozenset(record.robot.id for record in known if principal.sees(record.robot.id))


async def _seen(request: Request, letter_id: str) -> Delivery:
    found = await services_of(request).queue.delivery(letter_id)
    principal = principal_of(request)
    if found is None or found.state != DEAD or not (principal.sees_all or principal.sees(found.put.robot)):
        raise UnknownDeadLetterError(f"there is no dead letter {letter_id[:64]!r}")
    return found


def _place(before: str) -> tuple[int, str] | None:
    if not before:
        return None
    at, _, letter = before.partition(".")
    if not at.isascii() or not at.isdigit() or not letter:
        raise InvalidRequestError("before is the `next` of a page")
    return int(at), letter


def _words(ids: list[str], kind: str, target: str) -> str:
    said: dict[str, Any] = {"kind": kind, "target": target}
    named = " ".join(f"{name} {value}" for name, value in said.items() if value)
    return f"{len(ids)} ids" if ids else named or "all"
