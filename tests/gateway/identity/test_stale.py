"""A database that cannot be asked: links live on for a while alone, as others may have revoked them unheard."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import UnprovenError
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.identity.identity_rig import open_identity_rig
from tests.support.servers.databases import on_both


@on_both
async def test_while_the_database_is_away_links_live_on_for_a_while_alone(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        admitted = Admitted("arm", held.serial, rig.clock.wall_ns() + 10**15)
        nameless = Admitted("sim_1")
        rig.clock.advance(LIMITS.identities_stale_s)
        for one in (admitted, nameless):
            rig.robots.recheck(one)
        rig.clock.advance(1.0)
        if not rig.store.shared:  # nobody else can have revoked anybody
            rig.robots.recheck(admitted)
            return
        for one in (admitted, nameless):
            with pytest.raises(UnprovenError) as ended:
                rig.robots.recheck(one)
            assert ended.value.code == "unsettled"
        await rig.robots.refresh()
        rig.robots.recheck(admitted)


async def test_who_comes_while_it_is_unknown_who_was_revoked_is_not_let_in(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        rig.clock.advance(LIMITS.identities_stale_s + 1.0)
        rig.robots._look = never_received  # type: ignore[method-assign]
        hello, peer = link_pb2.Hello(robot_id="arm"), Peer(held.certificate.encode())
        if not rig.store.shared:
            assert (await rig.robots.admit(hello, peer, nobody_asks)).serial == held.serial
            return
        with pytest.raises(UnprovenError) as refused:
            await rig.robots.admit(hello, peer, nobody_asks)
        assert refused.value.code == "unsettled"


async def never_received() -> None:
    """The database does not answer."""


async def nobody_asks(challenge: link_pb2.Challenge) -> bytes:
    """TLS has proven it."""
    raise AssertionError
