"""Another master key: whatever stops it, and wherever, the gateway goes on, and the next try ends well."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.domain.account import LAMBDA
from gateway.domain.principal import Role
from gateway.errors import DamagedError
from gateway.identity.certificates.authorities import PURPOSE as CA
from gateway.identity.keys import PURPOSE, KeyRequest, NewKey, create_key, key_secret
from gateway.identity.master import MASTER_KEY, NEXT_KEY, MasterKey
from gateway.identity.rekey import begin, finish, reseal
from gateway.store.engine import StoreEngine
from tests.gateway.identity.identity_rig import open_identity_rig
from tests.support.servers.databases import on_both

WANTED = KeyRequest("ci", Role.VIEWER, scopes=frozenset({LAMBDA}))


def making(master: MasterKey) -> Callable[[StoreEngine], NewKey]:
    """A job that makes a key whose secret is sealed."""
    return lambda engine: create_key(engine, WANTED, owner=None, master=master, now_ns=1)


def reading(key_id: str, master: MasterKey) -> Callable[[StoreEngine], str]:
    """A job that opens the sealed secret of a key."""

    def job(engine: StoreEngine) -> str:
        found = key_secret(engine, key_id, master, now_ns=1)
        assert found is not None
        return found[1]

    return job


@on_both
@pytest.mark.parametrize("killed_after", ["begin", "reseal", "nothing"])
async def test_a_gateway_opens_and_seals_wherever_it_was_stopped_and_the_next_try_ends_well(
    tmp_path: Path, store_url: str, killed_after: str
) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.authorities.issuing()
        running = MasterKey.load_or_make(tmp_path)  # as a gateway that runs all the while holds it
        before = (tmp_path / MASTER_KEY).read_bytes()
        made = [await rig.store.run(making(running))]
        old, new = begin(tmp_path / MASTER_KEY)
        if killed_after != "begin":
            assert (await rig.store.run(lambda engine: reseal(engine, old, new))) == (2, ())
        if killed_after == "nothing":
            finish(tmp_path / MASTER_KEY)
        for master in (running, MasterKey.load_or_make(tmp_path)):
            made.append(await rig.store.run(making(master)))
            for one in made:
                assert await rig.store.run(reading(one.key.id, master)) == one.secret
        old, new = begin(tmp_path / MASTER_KEY)
        assert (await rig.store.run(lambda engine: reseal(engine, old, new))) == (4, ())
        finish(tmp_path / MASTER_KEY)
        assert not (tmp_path / NEXT_KEY).exists()
        assert (tmp_path / MASTER_KEY).read_bytes() != before
        for master in (running, MasterKey.load_or_make(tmp_path)):
            for one in made:
                assert await rig.store.run(reading(one.key.id, master)) == one.secret
        stolen = MasterKey(before)
        for one in made:
            with pytest.raises(DamagedError):
                await rig.store.run(reading(one.key.id, stolen))
        rig.authorities._opened.clear()
        assert (await rig.authorities.issuing()).key is not None


async def test_what_another_master_key_sealed_is_named_and_stays_as_it_is(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.authorities.issuing()
        other = MasterKey(b"x" * 32)
        made = await rig.store.run(making(other))
        old, new = begin(tmp_path / MASTER_KEY)
        done = await rig.store.run(lambda engine: reseal(engine, old, new))
        finish(tmp_path / MASTER_KEY)
        assert (done.sealed, done.foreign) == (1, (f"{PURPOSE} {made.key.id}",))
        assert await rig.store.run(reading(made.key.id, other)) == made.secret


def test_a_running_gateway_takes_the_new_key_and_keeps_what_it_has_when_the_files_are_gone(tmp_path: Path) -> None:
    running = MasterKey.load_or_make(tmp_path)
    first = running.seal(CA, "1", b"plain")
    begin(tmp_path / MASTER_KEY)
    second = running.seal(CA, "1", b"plain")
    assert [running.open(CA, "1", sealed) for sealed in (first, second)] == [b"plain"] * 2
    finish(tmp_path / MASTER_KEY)
    finish(tmp_path / MASTER_KEY)  # again is nothing
    assert MasterKey.load_or_make(tmp_path).open(CA, "1", second) == b"plain"
    assert running.open(CA, "1", second) == b"plain"
    with pytest.raises(DamagedError):
        running.open(CA, "1", first)
    (tmp_path / MASTER_KEY).unlink()
    assert running.open(CA, "1", running.seal(CA, "1", b"plain")) == b"plain"
