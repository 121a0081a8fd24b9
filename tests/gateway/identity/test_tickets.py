"""Tickets: no stronger than who made them, at any time; nobody else can make one, and they end."""

from __future__ import annotations

import base64
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from gateway.domain.principal import NOBODY, Principal, Role
from gateway.errors import ForbiddenError, InvalidRequestError
from gateway.identity.errors import UnknownUserError
from gateway.identity.tickets import Tickets, is_ticket
from gateway.identity.users import change_user, create_user
from gateway.store import Store
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.identity.identity_rig import opened_store
from tests.support.servers.databases import on_both


@pytest.fixture
async def store(tmp_path: Path, store_url: str) -> AsyncIterator[Store]:
    async with opened_store(tmp_path, store_url) as opened:
        yield opened


async def somebody(store: Store, role: Role, robots: tuple[str, ...] = ("*",), name: str = "ada") -> Principal:
    user = await store.run(lambda engine: create_user(engine, name, role=role, robots=robots, now_ns=1))
    return Principal(kind="user", id=user.id, name=user.name, role=user.role, robots=user.robots)


async def test_a_ticket_is_its_makers_rights_or_fewer(store: Store) -> None:
    tickets = Tickets(store, clock=ManualClock())
    await tickets.load()
    maker = await somebody(store, Role.OPERATOR, ("r1", "sim_*"))
    made = await tickets.make(maker, role=Role.VIEWER, robots=["sim_3"], ttl_s=60)
    assert is_ticket(made.text)
    assert made.text not in repr(made)
    found = await tickets.by_key(made.text)
    assert found is not None
    assert (found.kind, found.id, found.role, found.robots) == ("user", maker.id, Role.VIEWER, ("sim_3",))
    whole = await tickets.by_key((await tickets.make(maker, role=Role.OPERATOR, robots=None, ttl_s=60)).text)
    assert whole is not None
    assert (whole.role, whole.robots) == (Role.OPERATOR, ("r1", "sim_*"))
    for role, robots in ((Role.ADMIN, ["r1"]), (Role.VIEWER, ["r2"]), (Role.VIEWER, ["*"])):
        with pytest.raises(ForbiddenError):
            await tickets.make(maker, role=role, robots=robots, ttl_s=60)


async def test_it_ends_with_its_time_and_with_its_maker(store: Store) -> None:
    clock = ManualClock()
    tickets = Tickets(store, clock=clock)
    await tickets.load()
    maker = await somebody(store, Role.OPERATOR)
    text = (await tickets.make(maker, role=Role.OPERATOR, robots=None, ttl_s=60)).text
    await store.run(lambda engine: change_user(engine, "ada", role=Role.VIEWER))
    lowered = await tickets.by_key(text)
    assert lowered is not None
    assert lowered.role is Role.VIEWER
    await store.run(lambda engine: change_user(engine, "ada", robots=("r1",)))
    assert await tickets.by_key(text) is None
    await store.run(lambda engine: change_user(engine, "ada", robots=("*",)))
    assert await tickets.by_key(text) is not None
    await store.run(lambda engine: change_user(engine, "ada", disabled=True))
    assert await tickets.by_key(text) is None
    await store.run(lambda engine: change_user(engine, "ada", disabled=False))
    clock.advance(61)
    assert await tickets.by_key(text) is None


@on_both
async def test_every_gateway_of_the_store_knows_it(store: Store) -> None:
    one, two = Tickets(store, clock=ManualClock()), Tickets(store, clock=ManualClock())
    await one.load()
    text = (await one.make(await somebody(store, Role.VIEWER), role=Role.VIEWER, robots=None, ttl_s=60)).text
    assert await two.by_key(text) is None  # it has not learned the store's secret yet
    await two.load()
    assert await two.by_key(text) is not None


async def test_what_nobody_made_is_none(store: Store) -> None:
    tickets = Tickets(store, clock=ManualClock())
    await tickets.load()
    text = (await tickets.make(await somebody(store, Role.VIEWER), role=Role.VIEWER, robots=None, ttl_s=60)).text
    payload, _, mac = text.removeprefix("mrt_").partition(".")
    said = base64.urlsafe_b64decode(payload + "=" * (-len(payload) % 4)).replace(b",1,", b",3,")
    stronger = base64.urlsafe_b64encode(said).rstrip(b"=").decode()
    assert stronger != payload
    for wrong in (f"mrt_{stronger}.{mac}", f"mrt_{payload}.", f"mrt_{payload}", "mrt_", "mrt_é.é", text[4:], ""):
        assert await tickets.by_key(wrong) is None, wrong
    assert await tickets.by_session(text) is None


async def test_what_cannot_be_asked_for(store: Store) -> None:
    tickets = Tickets(store, clock=ManualClock())
    await tickets.load()
    maker = await somebody(store, Role.VIEWER)
    for robots, ttl_s in ((["a b"], 60.0), ([], 60.0), (None, 0.0), (None, LIMITS.ticket_s + 1)):
        with pytest.raises(InvalidRequestError):
            await tickets.make(maker, role=Role.VIEWER, robots=robots, ttl_s=ttl_s)
    with pytest.raises(InvalidRequestError, match="URL"):
        await tickets.make(maker, role=Role.VIEWER, robots=[f"r{n}" * 8 for n in range(60)], ttl_s=60)
    with pytest.raises(ForbiddenError):
        await tickets.make(NOBODY, role=Role.NONE, robots=None, ttl_s=60)
    unknown = Principal(kind="user", id="0" * 16, name="eve", role=Role.VIEWER, robots=("*",))
    with pytest.raises(UnknownUserError):
        await tickets.make(unknown, role=Role.VIEWER, robots=None, ttl_s=60)
