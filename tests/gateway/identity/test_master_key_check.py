"""A gateway finds out whether it has the master key of its store."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.domain.account import LAMBDA
from gateway.domain.principal import Role
from gateway.identity.keys import KeyRequest, create_key
from gateway.identity.master import MASTER_KEY, MasterKey
from gateway.identity.master_key_check import check_master
from gateway.identity.rekey import begin, finish, reseal
from metaros.errors import ConfigError
from tests.gateway.identity.identity_rig import opened_store
from tests.support.servers.databases import on_both

OWN, OTHER = MasterKey(b"o" * 32), MasterKey(b"x" * 32)


async def test_the_first_key_is_the_stores(tmp_path: Path, store_url: str, caplog: pytest.LogCaptureFixture) -> None:
    async with opened_store(tmp_path, store_url) as store:
        caplog.clear()  # of what a store says of its database
        for _ in range(2):
            await check_master(store, OWN, required=True)
        with pytest.raises(ConfigError, match="--master-key"):
            await check_master(store, OTHER, required=True)
        assert caplog.text == ""
        await check_master(store, OTHER, required=False)
        assert "--master-key" in caplog.text


async def test_what_an_earlier_version_sealed_says_whose_the_store_is(tmp_path: Path, store_url: str) -> None:
    wanted = KeyRequest("ci", Role.VIEWER, scopes=frozenset({LAMBDA}))
    async with opened_store(tmp_path, store_url) as store:
        await store.run(lambda engine: create_key(engine, wanted, owner=None, master=OWN, now_ns=1))
        with pytest.raises(ConfigError):
            await check_master(store, OTHER, required=True)
        await check_master(store, OWN, required=True)


@on_both
async def test_a_new_master_key_is_the_stores_from_then_on(tmp_path: Path, store_url: str) -> None:
    file = tmp_path / MASTER_KEY
    running = MasterKey.load_or_make(tmp_path, file)
    async with opened_store(tmp_path, store_url) as store:
        await check_master(store, running, required=True)
        old, new = begin(file)
        await check_master(store, running, required=True)
        await store.run(lambda engine: reseal(engine, old, new))
        for master in (running, new):
            await check_master(store, master, required=True)
        finish(file)
        await check_master(store, running, required=True)
        with pytest.raises(ConfigError):
            await check_master(store, old, required=True)
