"""The repository as a robot sees it, and everything that it does not take from people."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from tuf.api.metadata import Metadata, Root, Snapshot, Targets, Timestamp

from gateway.errors import BodyTooLargeError, TooManyError
from gateway.fleet.updates import offline
from gateway.fleet.updates.errors import NoRootError, UnknownUpdateError, UpdateRefusedError, WithdrawnError
from gateway.fleet.updates.publish import Upload
from metaros.clock import ManualClock, SystemClock
from metaros.errors import ConfigError
from metaros.fleet.bundle import BundleError
from metaros.limits import LIMITS
from tests.gateway.fleet.updates.repositories import (
    Robot,
    passphrase,
    publish_folder,
    repository,
    set_up,
    ship,
    upload,
)
from tests.support.deployment.bundles import WHEEL, make_bundle
from tests.support.servers.databases import on_both
from tests.support.servers.postgres import PostgresServer

PATH = "nodes/lidar-node/1.0.0.zip"
DAY_NS = 86_400 * 10**9
NOW_NS = 1_800_000_000 * 10**9


def first_root(people: Path) -> bytes:
    """What is given to a robot when it is set up."""
    return (people / "metadata" / "1.root.json").read_bytes()


def lazy(text: bytes) -> Metadata[Any]:
    return Metadata.from_bytes(text)


@on_both
async def test_a_robot_gets_what_people_signed(tmp_path: Path, store_url: str) -> None:
    people = tmp_path / "people"
    async with repository(tmp_path / "gateway", store_url) as made:
        published = await set_up(made, people, "1.0.0")
        assert published == {"root": 1, "targets": 1, "snapshot": 1, "timestamp": 1}
        robot = Robot(tmp_path / "robot", made, first_root(people))
        assert await robot.get(PATH) == (tmp_path / "made" / "lidar-node-1.0.0.zip").read_bytes()
        assert await robot.get("nodes/lidar-node/2.0.0.zip") is None
        await ship(made, people, "2.0.0")
        assert await robot.get("nodes/lidar-node/2.0.0.zip") is not None
        assert await made.available("node", "lidar-node", "2.0.0")
        assert not await made.available("node", "lidar-node", "3.0.0")


async def test_a_group_has_targets_of_its_own(tmp_path: Path, store_url: str) -> None:
    people, path = tmp_path / "people", "robots/field/nodes/lidar-node/1.0.0.zip"
    now_ns = SystemClock().wall_ns()
    async with repository(tmp_path / "gateway", store_url) as made:
        online = await made.online_keys()
        offline.init_root(people, online, passphrase, now_ns=now_ns)
        assert await made.online_keys() == online  # made once: robots trust these
        bundle = make_bundle(tmp_path / "made")
        assert offline.add(people, bundle, group="field", passphrase=passphrase) == path
        for role in ("targets", "robots/field"):
            offline.sign_role(people, role, passphrase, now_ns=now_ns)
        assert (await publish_folder(made, people))["robots/field"] == 1
        robot = Robot(tmp_path / "robot", made, first_root(people))
        assert await robot.get(path) == bundle.read_bytes()
        assert "http://gateway/metadata/1.robots%2Ffield.json" in robot.fetcher.asked
        assert await made.available("node", "lidar-node", "1.0.0")


@on_both
async def test_a_new_root_reaches_robots(tmp_path: Path, store_url: str) -> None:
    """A lost key is replaced, the gateway's too; who knows the first root alone follows."""
    people, now_ns = tmp_path / "people", SystemClock().wall_ns()
    async with repository(tmp_path / "gateway", store_url) as made:
        await set_up(made, people, "1.0.0")
        fresh = await made.online_keys(fresh=True)
        offline.rotate_root(people, online=fresh, replace="root-2", passphrase=passphrase, now_ns=now_ns)
        assert not offline.sign_root(people, ["root-1"], passphrase, now_ns=now_ns)
        assert offline.sign_root(people, ["root-3"], passphrase, now_ns=now_ns)
        assert (await publish_folder(made, people))["root"] == 2
        root = lazy((await made.metadata("2.root.json")).document).signed
        snapshot = lazy((await made.documents())["snapshot"].document)
        assert isinstance(root, Root)
        root.verify_delegate(Snapshot.type, snapshot.signed_bytes, snapshot.signatures)
        assert await Robot(tmp_path / "robot", made, first_root(people)).get(PATH) is not None


async def test_a_root_that_drops_the_targets_key_needs_new_targets(tmp_path: Path) -> None:
    people, now_ns = tmp_path / "people", SystemClock().wall_ns()
    async with repository(tmp_path / "gateway") as made:
        await set_up(made, people, "1.0.0")
        offline.rotate_root(people, online=None, replace="targets-1", passphrase=passphrase, now_ns=now_ns)
        assert offline.sign_root(people, ["root-1", "root-2"], passphrase, now_ns=now_ns)
        with pytest.raises(UpdateRefusedError, match="targets: not signed"):
            await publish_folder(made, people)
        assert (await made.documents())["root"].version == 1  # nothing of it happened
        await ship(made, people)
        assert (await made.documents())["root"].version == 2
        assert await Robot(tmp_path / "robot", made, first_root(people)).get(PATH) is not None


Change = Callable[[Metadata[Any]], None]


def _expire(one: Metadata[Any]) -> None:
    one.signed.expires = one.signed.expires.replace(year=2020)


def _again(one: Metadata[Any]) -> None:
    one.signed.version = 1
    one.signed.expires += timedelta(days=1)


def _rename(one: Metadata[Any]) -> None:
    one.signed.targets["nodes/other/1.0.0.zip"] = one.signed.targets.pop(PATH)


def _custom(one: Metadata[Any]) -> None:
    one.signed.targets[PATH].unrecognized_fields["custom"]["min_version"] = "0.1"


def _hash(one: Metadata[Any]) -> None:
    one.signed.targets[PATH].hashes["sha256"] = "0" * 64


def _absent(one: Metadata[Any]) -> None:
    target = one.signed.targets[PATH]
    target.unrecognized_fields["custom"]["version"] = "9.9.9"
    one.signed.targets["nodes/lidar-node/9.9.9.zip"] = target
    del one.signed.targets[PATH]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_expire, "it ended"),
        (_rename, "belong"),
        (_custom, "something else of itself"),
        (_hash, "other bytes"),
        (_absent, "upload it first"),
        (_again, "another version 1"),
    ],
)
async def test_signed_targets_that_do_not_fit(tmp_path: Path, change: Change, message: str) -> None:
    people = tmp_path / "people"
    async with repository(tmp_path / "gateway") as made:
        await set_up(made, people, "1.0.0")
        before = await made.documents()
        one = lazy((people / "metadata" / "1.targets.json").read_bytes())
        one.signed.version = 2
        change(one)
        one.sign(offline._signer(people, "targets-1", passphrase))
        with pytest.raises(UpdateRefusedError, match=message):
            await made.publish(Upload(targets=one.to_bytes()))
        assert await made.documents() == before


async def test_targets_that_their_key_did_not_sign(tmp_path: Path) -> None:
    people = tmp_path / "people"
    async with repository(tmp_path / "gateway") as made:
        await set_up(made, people, "1.0.0")
        one = lazy((people / "metadata" / "1.targets.json").read_bytes())
        one.signed.version = 2
        for key in ("root-1", "root-2"):
            one.sign(offline._signer(people, key, passphrase))
            with pytest.raises(UpdateRefusedError, match="not signed"):
                await made.publish(Upload(targets=one.to_bytes()))
        for text in (b"", b"{}", b"[" * 100_000, one.to_bytes() + b" " * 600_000, first_root(people)):
            with pytest.raises(UpdateRefusedError):
                await made.publish(Upload(targets=text))


async def test_targets_do_not_go_back(tmp_path: Path) -> None:
    people = tmp_path / "people"
    async with repository(tmp_path / "gateway") as made:
        await set_up(made, people, "1.0.0")
        await ship(made, people, "2.0.0")
        with pytest.raises(UpdateRefusedError, match="older"):
            await made.publish(Upload(targets=(people / "metadata" / "1.targets.json").read_bytes()))
        assert (await publish_folder(made, people))["targets"] == 2  # the newest again changes nothing


async def test_a_root_needs_two_of_three_and_the_gateways_keys(tmp_path: Path) -> None:
    people, now_ns = tmp_path / "people", SystemClock().wall_ns()
    async with repository(tmp_path / "gateway") as made, repository(tmp_path / "other", key=b"o" * 32) as other:
        with pytest.raises(NoRootError):
            await made.publish(Upload())
        offline.init_root(people, await other.online_keys(), passphrase, now_ns=now_ns)
        with pytest.raises(UpdateRefusedError, match="none of this store's keys"):
            await made.publish(Upload(roots=[first_root(people)]))
        await other.publish(Upload(roots=[first_root(people)]))
        offline.rotate_root(people, online=None, replace="", passphrase=passphrase, now_ns=now_ns)
        offline.sign_root(people, ["root-2"], passphrase, now_ns=now_ns)
        second = (people / "metadata" / "2.root.json").read_bytes()
        with pytest.raises(UpdateRefusedError, match="root: not signed"):
            await other.publish(Upload(roots=[second]))
        offline.sign_root(people, ["root-3"], passphrase, now_ns=now_ns)
        second = (people / "metadata" / "2.root.json").read_bytes()
        with pytest.raises(UpdateRefusedError, match="version 1"):
            await made.publish(Upload(roots=[second]))
        assert (await other.publish(Upload(roots=[second])))["root"] == 2


async def test_a_version_is_for_ever(tmp_path: Path, store_url: str) -> None:
    async with repository(tmp_path / "gateway", store_url) as made:
        first = await upload(made, make_bundle(tmp_path / "a"))
        assert await upload(made, make_bundle(tmp_path / "a")) == first
        with pytest.raises(UpdateRefusedError, match="other bytes"):
            await upload(made, make_bundle(tmp_path / "b", extra='hw = ["x"]\n'))
        (tmp_path / "junk.zip").write_bytes(b"PK" * 1000)
        with pytest.raises(BundleError):
            await upload(made, tmp_path / "junk.zip")
        assert [one.path for one in await made.bundles()] == [PATH]
        assert list((tmp_path / "gateway" / "incoming").iterdir()) == []
        assert len(list((tmp_path / "gateway" / "objects" / "updates").iterdir())) == 1


async def test_bundles_have_bounds(tmp_path: Path) -> None:
    limits = replace(LIMITS, bundle_bytes=2000, bundles=1)
    async with repository(tmp_path / "gateway", limits=limits) as made:
        large = make_bundle(tmp_path, members={WHEEL: hashlib.shake_128(b"noise").digest(4000)})
        with pytest.raises(BodyTooLargeError):
            await upload(made, large)
        await upload(made, make_bundle(tmp_path / "a"))
        with pytest.raises(TooManyError):
            await upload(made, make_bundle(tmp_path / "a", version="2.0.0"))
        assert list((tmp_path / "gateway" / "incoming").iterdir()) == []


async def test_no_robot_keeps_the_others_from_their_downloads(tmp_path: Path) -> None:
    people = tmp_path / "people"
    async with repository(tmp_path / "gateway") as made:
        await set_up(made, people, "1.0.0")
        bundle = await made.bundle(PATH)
        held = [made.fetch(bundle, robot="greedy") for _ in range(LIMITS.robot_downloads)]
        with pytest.raises(TooManyError, match="greedy"):
            made.fetch(bundle, robot="greedy")
        other = made.fetch(bundle, robot="other")
        assert b"".join([piece async for piece in other.pieces()])
        for one in (*held, other, other):  # closed twice counts once
            one.close()
        for robot in ("greedy", "greedy", "other"):
            made.fetch(bundle, robot=robot)
        with pytest.raises(TooManyError):
            made.fetch(bundle, robot="greedy")


@on_both
async def test_a_withdrawn_version_is_not_handed_out(tmp_path: Path, store_url: str) -> None:
    async with repository(tmp_path / "gateway", store_url) as made:
        await set_up(made, tmp_path / "people", "1.0.0")
        digest = (await made.bundle(PATH)).sha256
        asked = f"nodes/lidar-node/{digest}.1.0.0.zip"
        assert (await made.target(asked)).path == PATH
        assert (await made.withdraw(PATH, "burns motors")).withdrawn_ns
        with pytest.raises(WithdrawnError, match="burns motors"):
            await made.target(asked)
        assert not await made.available("node", "lidar-node", "1.0.0")
        for wrong in (PATH, asked.replace(digest, "0" * 64), "../x", "", "nodes/" * 50):
            with pytest.raises(UnknownUpdateError):
                await made.target(wrong)
        for wrong in ("root.json", "1.timestamp.json", "9.root.json", "../1.root.json", "1.robots/none.json", ""):
            with pytest.raises(UnknownUpdateError):
                await made.metadata(wrong)


async def test_what_ends_is_signed_again_in_time(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW_NS)
    async with repository(tmp_path / "gateway", store_url, clock=clock) as made:
        assert not await made.renew()  # there is nothing yet
        await set_up(made, tmp_path / "people", "1.0.0", now_ns=NOW_NS)
        assert not await made.renew()
        clock.advance(13 * 3600)
        assert await made.renew()
        found = await made.documents()
        assert (found[Timestamp.type].version, found[Snapshot.type].version) == (2, 1)
        clock.advance(4 * 86_400)
        assert await made.renew()
        found = await made.documents()
        assert (found[Timestamp.type].version, found[Snapshot.type].version) == (3, 2)
        assert found[Timestamp.type].expires_ns - clock.wall_ns() == DAY_NS


async def test_one_gateway_signs_and_all_serve(tmp_path: Path, postgres: PostgresServer) -> None:
    store_url = postgres.schema()
    clock = ManualClock(wall_ns=NOW_NS)
    objects = tmp_path / "objects"
    async with (
        repository(tmp_path / "a", store_url, clock=clock, objects=objects) as first,
        repository(tmp_path / "b", store_url, clock=clock, objects=objects) as second,
        repository(tmp_path / "c", store_url, clock=clock, objects=objects, key=b"c" * 32) as stranger,
    ):
        await set_up(first, tmp_path / "people", "1.0.0", now_ns=NOW_NS)
        assert (await second.documents()) == (await first.documents())
        clock.advance(13 * 3600)
        with pytest.raises(UpdateRefusedError, match="master key"):
            await stranger.renew()  # and it does not keep the turn
        assert [await second.renew(), await first.renew(), await second.renew()] == [True, False, False]
        clock.advance(13 * 3600)
        assert await first.renew()  # the other one is gone, as far as anybody knows


def test_a_folder_of_people(tmp_path: Path) -> None:
    online = {role: _public(tmp_path, role) for role in ("snapshot", "timestamp")}
    people = tmp_path / "people"
    with pytest.raises(ConfigError, match="shorter than 8"):
        offline.init_root(tmp_path / "short", online, lambda name: b"1234567", now_ns=NOW_NS)
    with pytest.raises(UpdateRefusedError, match="online keys"):
        offline.init_root(tmp_path / "none", {"snapshot": {}}, passphrase, now_ns=NOW_NS)
    root = offline.init_root(people, online, passphrase, now_ns=NOW_NS)
    assert (root.signed.roles["root"].threshold, len(root.signed.roles["root"].keyids)) == (2, 3)
    with pytest.raises(ConfigError, match="already"):
        offline.init_root(people, online, passphrase, now_ns=NOW_NS)
    for path in (people / "keys").glob("*.pem"):
        assert path.read_bytes().startswith(b"-----BEGIN ENCRYPTED PRIVATE KEY-----")
        assert path.stat().st_mode & 0o077 == 0
    with pytest.raises(ConfigError, match="not opened by this passphrase"):
        offline.sign_role(people, "targets", lambda name: b"wrong horse", now_ns=NOW_NS)
    with pytest.raises(ConfigError, match="nothing signed"):
        offline.release(people)
    offline.add(people, make_bundle(tmp_path / "a"))
    with pytest.raises(ConfigError, match="for ever"):
        offline.add(people, make_bundle(tmp_path / "b", extra='hw = ["x"]\n'))
    offline.sign_role(people, "targets", passphrase, now_ns=NOW_NS)
    offline.remove(people, PATH)
    second = offline.sign_role(people, "targets", passphrase, now_ns=NOW_NS)
    assert isinstance(second.signed, Targets)
    assert (second.signed.version, dict(second.signed.targets)) == (2, {})
    with pytest.raises(ConfigError, match="no target"):
        offline.remove(people, PATH)


def _public(_folder: Path, _role: str) -> dict[str, Any]:
    from securesystemslib.signer import CryptoSigner

    public = CryptoSigner.generate_ed25519().public_key
    return json.loads(json.dumps({"keyid": public.keyid, "key": public.to_dict()}))
