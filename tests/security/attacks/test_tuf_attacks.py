"""Attacks on updates: a repository, its server and the way to it are the attacker's. The old version runs on."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest
from securesystemslib.signer import CryptoSigner

from edge_agent.update.files import read_table
from edge_agent.update.slots import python_of
from tests.support.robots.tuf_robot import OLD, Hurry, TufRobot, tuf_robot
from tests.support.servers.tuf_repository import Fault, Served, TufRepository, make_bundle, plain, target_file

pytestmark = pytest.mark.integration

World = tuple[TufRobot, TufRepository, Served]
AGENT = "agents/metaros/2.1.0.zip"


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    with tuf_robot(tmp_path) as found:
        yield found


async def look(robot: TufRobot) -> None:
    """A look at a repository that is as it should be, in which there is nothing to install."""
    assert await robot.attempt("9.9.9") == "update_unknown"


async def refused(robot: TufRobot, code: str, version: str = "2.1.0") -> None:
    """The attack is refused by name, now and after a restart of the agent."""
    for _ in range(2):
        assert await robot.attempt(version) == code, robot.updates.reported()
        robot.check_old_runs()
        robot.begin()


async def test_without_an_attack_the_version_is_installed(world: World) -> None:
    robot, _, served = world
    served.token = robot.source.token = "mrf_secret"
    assert await robot.attempt() == "", robot.updates.reported()
    current = robot.slots.boot(most=3)
    assert (current.slot, current.version, current.previous, current.probing) == ("b", "2.1.0", "a", True)
    assert python_of(robot.slots.path("b")).exists()
    assert robot.restarts == 1


async def test_a_wrong_token_is_reported(world: World) -> None:
    robot, _, served = world
    served.token, robot.source.token = "mrf_other", "mrf_secret"
    assert await robot.attempt() == "update_fetch"
    robot.check_old_runs()


async def test_rollback_of_the_timestamp(world: World) -> None:
    robot, repository, _ = world
    old = repository.files["metadata/timestamp.json"]
    repository.publish()
    await look(robot)
    repository.files["metadata/timestamp.json"] = old
    await refused(robot, "update_rollback")


async def test_rollback_of_the_snapshot_with_a_stolen_timestamp_key(world: World) -> None:
    robot, repository, _ = world
    repository.publish()
    await look(robot)
    repository.snapshot.signed.version -= 1
    repository.publish_timestamp(repository.sign("snapshot"))
    await refused(robot, "update_rollback")


async def test_rollback_of_the_targets_with_stolen_online_keys(world: World) -> None:
    robot, repository, _ = world
    repository.publish()
    await look(robot)
    repository.targets.signed.version -= 1
    repository.publish_snapshot()
    await refused(robot, "update_rollback")


async def test_freeze(world: World) -> None:
    """The same files for ever: they are good until they expire, and no longer."""
    robot, _, _ = world
    await look(robot)
    robot.clock.advance(2 * 86_400)
    await refused(robot, "update_expired")


async def test_the_clock_is_set_back_to_keep_frozen_files_alive(world: World) -> None:
    robot, repository, _ = world
    old = dict(repository.files)
    robot.clock.advance(86_400 * 3)
    repository.now = repository.after(3)
    repository.publish()
    await look(robot)
    repository.files = old
    robot.clock.jump_wall(-86_400 * 3)
    shutil.rmtree(robot.source.folder / "metadata")  # not even a damaged disk helps
    await refused(robot, "update_expired")


async def test_the_time_that_was_seen_is_not_forgotten_when_the_clock_starts_at_1970(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    seen_ns = read_table(robot.source.folder / "seen.json")["time_ns"]
    robot.clock.jump_wall(-robot.clock.wall_ns() / 1e9)
    repository.timestamp.signed.expires = repository.after(-1)
    repository.timestamp.signed.version += 1
    repository.sign("timestamp")
    await refused(robot, "update_expired")
    assert read_table(robot.source.folder / "seen.json")["time_ns"] == seen_ns


async def test_mix_and_match(world: World) -> None:
    """Files that were each signed, but never together."""
    robot, repository, _ = world
    name = f"metadata/{repository.snapshot.signed.version + 1}.snapshot.json"
    old = repository.files[f"metadata/{repository.snapshot.signed.version}.snapshot.json"]
    repository.publish()
    repository.files[name] = old
    await refused(robot, "update_mismatch")


async def test_mix_and_match_of_the_targets(world: World) -> None:
    robot, repository, _ = world
    old = repository.files["metadata/1.targets.json"]
    repository.publish()
    repository.files["metadata/2.targets.json"] = old
    await refused(robot, "update_rollback")


async def test_fast_forward_and_the_way_out_of_it(world: World) -> None:
    """Stolen online keys drive the versions up; a root with other keys starts them anew."""
    robot, repository, _ = world
    repository.timestamp.signed.version = repository.snapshot.signed.version = 2**31
    repository.publish()
    await look(robot)
    repository.timestamp.signed.version = repository.snapshot.signed.version = 5
    repository.publish()
    await refused(robot, "update_rollback")
    repository.next_root()
    repository.replace_key("timestamp")
    repository.replace_key("snapshot")
    repository.sign_root(repository.root_keys)
    repository.publish()
    assert await robot.takes() == ""


def endless(handler: BaseHTTPRequestHandler, _: bytes) -> None:
    """Bytes without an end, of a length that is not said, or said to be huge."""
    handler.send_response(200)
    handler.send_header("Content-Length", str(1 << 40))
    handler.end_headers()
    while True:
        handler.wfile.write(bytes(1 << 16))


@pytest.mark.parametrize("name", ["timestamp.json", "2.root.json", "1.snapshot.json", "1.targets.json", ".zip"])
async def test_endless_data(world: World, name: str) -> None:
    robot, _, served = world
    await robot.attempt("9.9.9") if name == "2.root.json" else None
    served.misbehave(name, endless)
    await refused(robot, "update_too_large")
    assert sum(path.stat().st_size for path in robot.source.folder.rglob("*") if path.is_file()) < 1_000_000


async def test_a_body_without_a_length_is_not_read(world: World) -> None:
    def chunked(handler: BaseHTTPRequestHandler, data: bytes) -> None:
        handler.protocol_version = "HTTP/1.1"
        handler.send_response(200)
        handler.send_header("Transfer-Encoding", "chunked")
        handler.end_headers()
        while True:
            handler.wfile.write(b"1\r\nx\r\n")

    robot, _, served = world
    served.misbehave("timestamp.json", chunked)
    await refused(robot, "update_fetch")


@pytest.mark.parametrize("role", ["timestamp", "snapshot", "targets"])
async def test_wrong_key(world: World, role: str) -> None:
    robot, repository, _ = world
    repository.keys[role] = CryptoSigner.generate_ed25519()
    repository.publish()
    await refused(robot, "update_unsigned")


async def test_a_root_below_its_threshold(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    repository.next_root()
    repository.sign_root(repository.root_keys[:1])
    await refused(robot, "update_unsigned")


async def test_a_root_with_one_signature_twice(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    repository.next_root()
    repository.sign_root([repository.root_keys[0], repository.root_keys[0]])
    await refused(robot, "update_unsigned")


async def test_a_root_that_only_its_own_keys_have_signed(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    root, stranger = repository.next_root(), CryptoSigner.generate_ed25519()
    root.add_key(stranger.public_key, "root")
    root.roles["root"].keyids = [stranger.public_key.keyid]
    root.roles["root"].threshold = 1
    repository.sign_root([stranger])
    await refused(robot, "update_unsigned")


async def test_a_root_signed_by_old_and_new_keys_is_taken(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    root, lost, fresh = repository.next_root(), repository.root_keys.pop(), CryptoSigner.generate_ed25519()
    root.revoke_key(lost.public_key.keyid, "root")
    root.add_key(fresh.public_key, "root")
    repository.sign_root([*repository.root_keys, fresh])
    old = repository.replace_key("targets")
    repository.next_root()
    repository.sign_root([repository.root_keys[0], fresh])
    repository.publish()
    assert await robot.takes() == ""
    assert read_table(robot.source.folder / "seen.json")["root"] == 3
    repository.keys["targets"] = old
    repository.publish()
    assert await robot.attempt() == "update_unsigned"


async def test_a_replayed_old_root(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    repository.files["metadata/2.root.json"] = repository.files["metadata/1.root.json"]
    await refused(robot, "update_rollback")


async def test_a_revoked_key_does_not_come_back_with_the_old_roots(world: World) -> None:
    """The disk lost the signed files; the server hides the newer root, and gives what the revoked key signs."""
    robot, repository, _ = world
    old_root = repository.files["metadata/1.root.json"]
    repository.next_root()
    stolen = repository.replace_key("timestamp")
    repository.sign_root(repository.root_keys)
    repository.publish()
    await look(robot)
    shutil.rmtree(robot.source.folder / "metadata")
    del repository.files["metadata/2.root.json"]
    assert repository.files["metadata/1.root.json"] == old_root
    repository.timestamp.signed.version += 10
    repository.sign("timestamp", stolen)
    await refused(robot, "update_rollback")


async def test_another_first_root_is_not_taken_once_one_is_pinned(world: World) -> None:
    robot, repository, _ = world
    await look(robot)
    evil = TufRepository(repository.now)
    evil.add_agent("2.1.0")
    evil.publish()
    evil.publish()
    repository.files = evil.files
    shutil.rmtree(robot.source.folder / "metadata")
    await refused(robot, "update_unsigned")


@pytest.mark.parametrize("role", ["root", "targets", "snapshot", "timestamp"])
async def test_expired(world: World, role: str) -> None:
    robot, repository, _ = world
    if role == "root":
        repository.next_root().expires = repository.after(-1)
        repository.sign_root(repository.root_keys)
    else:
        getattr(repository, role).signed.expires = repository.after(-1)
        getattr(repository, role).signed.version += 1
        data = repository.sign(role)
        if role == "targets":
            repository.publish_snapshot()
        elif role == "snapshot":
            repository.publish_timestamp(data)
    await refused(robot, "update_expired")


async def test_other_bytes_of_the_same_length(world: World) -> None:
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, bytes(len(data))))
    await refused(robot, "update_mismatch")


async def test_a_shorter_file(world: World) -> None:
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, data[:-1]))
    await refused(robot, "update_mismatch")


async def test_a_longer_file(world: World) -> None:
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, data + b"x"))
    await refused(robot, "update_too_large")


async def test_truncated_and_gone_on_with(world: World) -> None:
    """A connection that breaks off is no harm: the next attempt asks for the rest alone."""
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, data[:100], size=len(data)))
    assert await robot.attempt() == "update_fetch"
    robot.check_old_runs()
    served.faults.clear()
    assert await robot.takes() == ""
    assert [span for path, span in served.asked if path.endswith(".zip")] == ["", "bytes=100-"]


async def test_a_poisoned_beginning_does_not_last(world: World) -> None:
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, bytes(100), size=len(data)))
    assert await robot.attempt() == "update_fetch"
    served.faults.clear()
    assert await robot.attempt() == "update_mismatch"
    robot.check_old_runs()
    assert await robot.takes() == ""


async def test_a_rest_that_begins_remote(world: World) -> None:
    robot, _, served = world
    served.misbehave(".zip", lambda handler, data: plain(handler, data[:100], size=len(data)))
    assert await robot.attempt() == "update_fetch"
    more = {"Content-Range": "bytes 50-99/100"}
    served.misbehave(".zip", lambda handler, data: plain(handler, data[50:], status=206, more=more))
    assert await robot.attempt() == "update_fetch"
    robot.check_old_runs()


def trickle(stop: threading.Event, *, head: bool) -> Fault:
    """One byte every tenth of a second, of the head or of the body."""

    def answer(handler: BaseHTTPRequestHandler, data: bytes) -> None:
        if not head:
            handler.send_response(200)
            handler.send_header("Content-Length", str(len(data)))
            handler.end_headers()
        for byte in b"HTTP/1.1 200 OK\r\nX-Slow: " * 1000 if head else data:
            handler.wfile.write(bytes([byte]))
            if stop.wait(0.1):
                return

    return answer


@pytest.mark.parametrize(("name", "before"), [("timestamp.json", "2.root.json"), (".zip", "1.targets.json")])
@pytest.mark.parametrize("head", [True, False], ids=["head", "body"])
async def test_slow_retrieval(world: World, name: str, before: str, head: bool) -> None:
    robot, _, served = world
    robot.patience = Hurry(served, before, head_s=0.3 if head else 60.0, span_s=0.3)
    robot.begin()
    served.misbehave(name, trickle(served.ending, head=head))
    assert await robot.attempt() == "update_slow"
    robot.check_old_runs()


async def test_silence(world: World) -> None:
    robot, _, served = world
    robot.patience = Hurry(served, "2.root.json", head_s=0.1, span_s=0.1)
    robot.begin()
    served.misbehave("timestamp.json", lambda handler, data: served.ending.wait(60) and None)
    assert await robot.attempt() == "update_slow"
    robot.check_old_runs()


async def test_a_redirect_is_not_followed(world: World) -> None:
    robot, _, served = world
    place = {"Location": f"{served.url}/api/v1/updates/metadata/1.root.json"}
    served.misbehave("timestamp.json", lambda handler, data: plain(handler, b"", status=302, more=place))
    await refused(robot, "update_fetch")


async def test_a_version_that_is_a_path(world: World) -> None:
    robot, _, served = world
    paths = ("../../../etc/passwd", "2.1.0/../../x", "2.1.0\0", "", "%2e%2e", "2.1.0 ")
    codes = {version: await robot.attempt(version) for version in paths}
    assert codes == dict.fromkeys(paths, "bundle_invalid")
    assert served.asked == []
    robot.check_old_runs()


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "files/../../evil", "wheels/..", "files/a\\..\\b", "evil.py"])
async def test_a_signed_bundle_with_a_path_out_of_it(world: World, name: str) -> None:
    """Whoever holds the keys of targets can make an agent do anything; but not write elsewhere by unpacking."""
    robot, repository, _ = world
    repository.add(AGENT, make_bundle("2.1.0", more={name: b"evil"}))
    repository.publish()
    await refused(robot, "update_metadata")
    assert not list(robot.state_dir.parent.rglob("evil*"))


async def test_a_delegation_outside_its_paths(world: World) -> None:
    """The role of one group signs what is not the group's to sign."""
    robot, repository, _ = world
    evil = make_bundle("2.2.0")
    role = repository.delegate("robots/west", ["robots/west/*/*/*"])
    for path in ("agents/metaros/2.2.0.zip", "robots/east/agents/metaros/2.2.0.zip"):
        role.targets[path] = target_file(path, evil)
        repository.put(path, evil)
    repository.publish()
    await refused(robot, "update_unknown", "2.2.0")


async def test_a_delegation_within_its_paths(world: World) -> None:
    robot, repository, _ = world
    role, path, data = (
        repository.delegate("robots/east", ["robots/east/*/*/*"]),
        "robots/east/agents/metaros/2.2.0.zip",
        b"",
    )
    data = make_bundle("2.2.0")
    role.targets[path] = target_file(path, data)
    repository.put(path, data)
    repository.publish()
    assert await robot.takes("2.2.0") == ""


async def test_below_the_minimum_version(world: World) -> None:
    """A version that was good once, is still signed, and has a hole."""
    robot, _, served = world
    robot.source.minimum.raise_to("metaros", "2.1.1")
    await refused(robot, "update_floor")
    assert served.asked == []
    robot.source.minimum.raise_to("metaros", "1.0.0")
    assert robot.source.minimum.of("metaros") == "2.1.1"


@pytest.mark.parametrize("rows", [{"hw": ["pdp11"]}, {"python": ">=3.99"}, {"python": "<3.11"}])
async def test_for_another_machine(world: World, rows: dict[str, object]) -> None:
    robot, repository, _ = world
    repository.add_agent("2.1.0", **rows)
    repository.publish()
    await refused(robot, "update_foreign")


async def test_a_bundle_that_says_another_version_than_its_path(world: World) -> None:
    robot, repository, _ = world
    repository.add(AGENT, make_bundle("1.0.0"))
    repository.publish()
    await refused(robot, "update_foreign")


async def test_the_bundle_changes_on_the_disk_after_it_was_checked(world: World, tmp_path: Path) -> None:
    robot, _, _ = world

    def swap(step: str) -> None:
        if step == "emptied":
            (robot.source.folder / "bundle.zip").write_bytes(make_bundle("2.1.0", more={"files/evil": b"evil"}))

    from edge_agent.update.errors import UpdateMismatchError

    with pytest.raises(UpdateMismatchError):
        robot.updates.install("2.1.0", swap)
    assert robot.slots.read().version == OLD
    assert not robot.slots.complete("b", "2.1.0")


GARBAGE = (b"", b"{", b"[]", b"null", b"[" * 20_000, b'{"signed": 1}', b"\xff" * 100)


@pytest.mark.parametrize("name", ["timestamp.json", "1.snapshot.json", "1.targets.json", "2.root.json"])
async def test_garbage(world: World, name: str) -> None:
    robot, _, served = world
    codes = {}
    for data in GARBAGE:
        served.misbehave(name, lambda handler, _, data=data: plain(handler, data))
        codes[data] = await robot.attempt()
        robot.check_old_runs()
    assert set(codes.values()) <= {"update_metadata", "update_mismatch", "update_too_large"}, codes


async def test_every_byte_of_the_kept_files_may_rot(world: World) -> None:
    """A damaged copy is fetched anew, or refused by name; it never makes an older file good."""
    robot, repository, _ = world
    await look(robot)
    old = repository.files["metadata/timestamp.json"]
    repository.publish()
    await look(robot)
    kept = robot.source.folder / "metadata" / "timestamp.json"
    whole = kept.read_bytes()
    repository.files["metadata/timestamp.json"] = old
    for at in range(0, len(whole), 37):
        kept.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        assert await robot.attempt() in ("update_rollback", "update_mismatch")
    robot.check_old_runs()
