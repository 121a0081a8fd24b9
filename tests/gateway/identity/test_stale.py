"""A database that cannot be asked: links live on for a while alone, as others may have revoked them unheard."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import UnprovenError
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.identity.desks import open_desks
from tests.support.databases import on_both


@on_both
async def test_while_the_database_is_away_links_live_on_for_a_while_alone(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held = await desks.enrolled()
        admitted = Admitted("arm", held.serial, desks.clock.wall_ns() + 10**15)
        nameless = Admitted("sim_1")
        desks.clock.advance(LIMITS.identities_stale_s)
        for one in (admitted, nameless):
            desks.robots.still(one)
        desks.clock.advance(1.0)
        if not desks.store.shared:  # nobody else can have revoked anybody
            desks.robots.still(admitted)
            return
        for one in (admitted, nameless):
            with pytest.raises(UnprovenError) as ended:
                desks.robots.still(one)
            assert ended.value.code == "unsettled"
        await desks.robots.refresh()
        desks.robots.still(admitted)


async def test_who_comes_while_it_is_unknown_who_was_revoked_is_not_let_in(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held = await desks.enrolled()
        desks.clock.advance(LIMITS.identities_stale_s + 1.0)
        desks.robots._look = never_heard  # type: ignore[method-assign]
        hello, peer = link_pb2.Hello(robot_id="arm"), Peer(held.certificate.encode())
        if not desks.store.shared:
            assert (await desks.robots.admit(hello, peer, nobody_asks)).serial == held.serial
            return
        with pytest.raises(UnprovenError) as refused:
            await desks.robots.admit(hello, peer, nobody_asks)
        assert refused.value.code == "unsettled"


async def never_heard() -> None:
    """The database does not answer."""


async def nobody_asks(challenge: link_pb2.Challenge) -> bytes:
    """TLS has proven it."""
    raise AssertionError
