"""Attacks on robots' identities at a real gateway: by gRPC and TLS, by WebSocket and challenge, by what is copied."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import sqlite3
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import grpc
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from gateway.identity import robots
from gateway.identity.certificates.ca import Authority, issue_robot, issue_server, make_intermediate, make_root, pem
from gateway.identity.master import MasterKey
from gateway.ingest import lane_server
from gateway.main import Ready
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.clock import SystemClock
from metaros.link.proof import link_statement, sign
from tests.gateway.harness import BACKFILL, CONTROL, DATA, client, running_gateway
from tests.gateway.identity.identity_rig import Held
from tests.gateway.identity.robot_keys import ask, new_key
from tests.gateway.test_robot_links import ADMIN, RING, alarm, bare, enrolled, greet, lane, revoke, said, tls_lane
from tests.support.processes.clock_jump import LeapingClock

pytestmark = pytest.mark.integration

HOUR_NS = 3_600_000_000_000
KINDS = ("grpc", "websocket")


def authority_of(ready: Ready) -> Authority:
    """The gateway's issuer, with the key that only its data directory has."""
    with contextlib.closing(sqlite3.connect(ready.data_dir / "gateway.sqlite")) as store:
        row = store.execute("SELECT authority, root, certificate, sealed_key FROM authorities").fetchone()
    plain = MasterKey.load_or_make(ready.data_dir).open("ca", row[0], row[3])
    root, issuer = (x509.load_pem_x509_certificate(text.encode()) for text in row[1:3])
    key: Any = serialization.load_pem_private_key(plain, password=None)
    return Authority(root, issuer, key)


def fleet_of(held: Held) -> str:
    """The fleet that a robot's certificate names."""
    names = x509.load_pem_x509_certificate(held.certificate.encode()).extensions
    value = names.get_extension_for_class(x509.SubjectAlternativeName).value[0].value
    return str(value).split("/")[2]


def dated(ready: Ready, held: Held, *, begins_ns: int, life_s: float) -> Held:
    """The same robot's certificate with other dates, from the real issuer."""
    made = issue_robot(
        authority_of(ready),
        held.key.public_key(),
        fleet=fleet_of(held),
        robot=held.robot,
        now_ns=begins_ns,
        life_s=life_s,
    )
    return Held(held.robot, held.key, pem(made))


async def test_a_certificate_counts_between_its_dates_alone(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        now_ns = SystemClock().wall_ns()
        over = dated(ready, held, begins_ns=now_ns - 2 * HOUR_NS, life_s=3600.0)
        soon = dated(ready, held, begins_ns=now_ns + HOUR_NS, life_s=3600.0)
        for number, kind in enumerate(KINDS, 1):
            for one, what in ((over, "certificate_expired"), (soon, "certificate_expired"), (held, "welcome")):
                async with lane(ready, kind) as opened:
                    assert await greet(opened, one.hello(number=number), one) == what, kind


async def test_a_live_link_ends_with_its_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots, "POLL_S", 0.05)
    clock = LeapingClock()
    async with (
        running_gateway(tmp_path, authenticator=RING, clock=clock) as ready,
        contextlib.AsyncExitStack() as stack,
    ):
        lanes = []
        for kind in KINDS:
            held, _ = await enrolled(ready, kind)
            brief = dated(ready, held, begins_ns=clock.wall_ns() - HOUR_NS, life_s=7200.0)
            lanes.append(await stack.enter_async_context(lane(ready, kind)))
            assert await greet(lanes[-1], brief.hello(), brief) == "welcome"
        clock.set_calendar(3600.0)
        for opened in lanes:
            assert (await said(opened)).code == "certificate_expired"


@pytest.mark.parametrize("kind", [*KINDS, "tls"])
async def test_a_live_link_is_cut(tmp_path: Path, kind: str) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on" if kind == "tls" else "off") as ready:
        held, given = await enrolled(ready)
        chain = given["certificate"] + given["chain"]
        way = tls_lane(ready, given["roots"], chain, held.key) if kind == "tls" else lane(ready, kind)
        async with way as opened:
            assert await greet(opened, held.hello(), held) == "welcome"
            cut = asyncio.create_task(said(opened))
            asked_s = asyncio.get_running_loop().time()
            await revoke(ready, "arm")
            assert (await cut).code == "certificate_revoked"
            cut_s = asyncio.get_running_loop().time() - asked_s
            print(f"cut over {kind} {cut_s * 1000:.0f} ms after the revocation was asked for")


async def test_an_expired_or_reused_or_foreign_token_is_refused_by_name(tmp_path: Path) -> None:
    async with (
        running_gateway(tmp_path / "a", authenticator=RING) as ready,
        running_gateway(tmp_path / "b", authenticator=RING) as other,
    ):
        async with client(ready, key=ADMIN) as http, client(other, key=ADMIN) as there:

            async def use(text: str, robot: str, *, at: Any = http, key: Any = None) -> str:
                body = {"token": text, "robot": robot, "csr": ask(key or new_key())}
                answer = await at.post("/api/v1/enrol", json=body)
                return "" if answer.status_code in (200, 201) else str(answer.json()["code"])

            async def token(**order: Any) -> str:
                return str((await http.post("/api/v1/enrolment-tokens", json=order)).json()["token"])

            text, key = await token(), new_key()
            assert await use(text, "arm", key=key) == ""
            assert await use(text, "arm", key=key) == ""
            assert await use(text, "arm") == "token_used"
            assert "another key" in await alarm(http, "arm")
            assert await use(await token(robot="leg"), "arm") == "token_foreign"
            await there.post("/api/v1/enrolment-tokens", json={})
            assert await use(await token(), "leg", at=there) == "token_foreign"
            late = await token()
            with contextlib.closing(sqlite3.connect(ready.data_dir / "gateway.sqlite", timeout=60)) as store, store:
                store.execute("UPDATE enrolment_tokens SET expires_ns = 1 WHERE token = ?", (late.split(".")[1],))
            assert await use(late, "leg") == "token_expired"
            right = await token()
            start, secret, pin = right.rsplit(".", 2)
            assert await use(f"{start}.{'0' * len(secret)}.{pin}", "leg") == "token_unknown"
            assert await use(f"mr1.{'0' * 12}.{secret}.{pin}", "leg") == "token_unknown"
            assert await use(right, "leg") == ""


async def test_a_hello_out_of_form_is_refused_before_it_is_proven(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        wrong: list[dict[str, Any]] = [
            {"lane": -1},
            {"lane": 4},
            {"session_id": b"x" * 4000},
            {"session_number": 2**64 - 1},
        ]
        for changes in (*wrong, {"robot_id": "a" * 100_000}, {"robot_id": "../arm"}, {"namespace": "/a b"}):
            hello = held.hello()
            for name, value in changes.items():
                setattr(hello, name, value)
            for kind in KINDS:
                async with lane(ready, kind) as opened:
                    assert await greet(opened, hello, held) == "protocol", (kind, changes)
        many = held.hello()
        many.certificates.extend([held.der] * 10)
        junk = held.hello()
        junk.certificates[0] = b"\x30\x82" + b"\xff" * 5000
        for hello, kind in itertools.product((many, junk), KINDS):
            async with lane(ready, kind) as opened:
                assert await greet(opened, hello, held) == "certificate_foreign"


@pytest.mark.parametrize("kind", KINDS)
async def test_a_proof_is_good_for_one_challenge_and_one_hello(tmp_path: Path, kind: str) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        hello = held.hello()
        async with lane(ready, kind) as opened:
            await opened.send(hello=hello)
            first = (await opened.next()).challenge
            old = held.prove(hello, first)
            await opened.send(proof=link_pb2.Proof(signature=old))
            assert (await opened.next()).HasField("welcome")

        async def answered(signature: Any, **changes: Any) -> str:
            """What a Hello gets whose challenge is answered by what `signature` makes of it."""
            shown = held.hello()
            for name, value in changes.items():
                setattr(shown, name, value)
            async with lane(ready, kind) as opened:
                await opened.send(hello=shown)
                challenge = (await opened.next()).challenge
                assert challenge.nonce != first.nonce
                await opened.send(proof=link_pb2.Proof(signature=signature(challenge)))
                return str((await opened.next()).goodbye.code)

        def statement(challenge: link_pb2.Challenge, **other: Any) -> bytes:
            parts = {"robot_id": "arm", "session_id": b"s" * 16, "session_number": 1, "lane": CONTROL}
            said = {"audience": challenge.audience, **parts, **other}
            return link_statement(challenge.nonce, **said)

        assert await answered(lambda challenge: old) == "proof_refused"  # replayed
        assert await answered(lambda challenge: b"") == "proof_refused"
        assert await answered(lambda challenge: b"\x30\x06\x02\x01\x00\x02\x01\x00") == "proof_refused"
        for other in (
            {"lane": DATA},
            {"session_id": b"t" * 16},
            {"session_number": 2},
            {"robot_id": "leg"},
            {"audience": "another fleet"},
        ):
            assert await answered(lambda it, other=other: sign(held.key, statement(it, **other))) == "proof_refused"
        # Somebody between swaps the Hello, and passes the robot's own answer on.
        for changed in ({"session_number": 9}, {"lane": BACKFILL}, {"session_id": b"u" * 16}):
            assert await answered(lambda it: sign(held.key, statement(it)), **changed) == "proof_refused"


async def test_challenges_that_nobody_answers_end_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, contextlib.AsyncExitStack() as stack:
        held, _ = await enrolled(ready)
        monkeypatch.setattr(lane_server, "HELLO_S", 3.0)
        hoard = [await stack.enter_async_context(lane(ready, kind)) for kind in KINDS for _ in range(20)]
        for opened in hoard:
            await opened.send(hello=held.hello())
        for opened in hoard:
            assert (await opened.next()).HasField("challenge")
        async with asyncio.timeout(60):
            for opened in hoard:
                with contextlib.suppress(Exception):  # however the end of a connection shows on this transport
                    await opened.next()
        for number, kind in enumerate(KINDS, 1):
            async with lane(ready, kind) as opened:
                assert await greet(opened, held.hello(number=number), held) == "welcome"


async def test_a_certificate_opens_only_its_own_robots_lanes(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on") as ready:
        arm, of_arm = await enrolled(ready)
        leg, of_leg = await enrolled(ready, "leg")
        roots = of_arm["roots"]
        async with tls_lane(ready, roots, of_arm["certificate"] + of_arm["chain"], arm.key) as control:
            assert await greet(control, bare("arm")) == "welcome"
            data = bare("arm")
            data.lane = DATA
            async with tls_lane(ready, roots, of_leg["certificate"] + of_leg["chain"], leg.key) as stolen:
                assert await greet(stolen, data) == "certificate_foreign"  # another lane of the same session
            data.certificates.append(arm.der)  # what a Hello says counts for nothing where TLS has spoken
            async with tls_lane(ready, roots, of_leg["certificate"] + of_leg["chain"], leg.key) as stolen:
                assert await greet(stolen, data) == "certificate_foreign"


def leaf_signed_by(held: Held, *, fleet: str) -> tuple[str, Any]:
    """A certificate that a robot issued to itself with its own, and its key."""
    key = new_key()
    own = x509.load_pem_x509_certificate(held.certificate.encode())
    above = Authority(own, own, held.key)
    now_ns = SystemClock().wall_ns()
    made = issue_robot(above, key.public_key(), fleet=fleet, robot="leg", now_ns=now_ns, life_s=3600.0)
    return pem(made) + held.certificate, key


@asynccontextmanager
async def plain_lane(ready: Ready) -> AsyncIterator[Any]:
    """gRPC without TLS to the port that speaks TLS."""
    async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
        yield link_pb2_grpc.LinkStub(channel).Connect()


async def spoken(call: Any) -> bool:
    """Say Hello; whether anything is answered."""
    await call.write(link_pb2.AgentFrame(hello=bare("arm")))
    return await call.read() is not grpc.aio.EOF


async def test_tls_lets_nobody_in_by_another_certificate(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on") as ready:
        held, given = await enrolled(ready)
        roots, fleet, now_ns = given["roots"], fleet_of(held), SystemClock().wall_ns()

        async def outcome(chain: str, key: Any) -> str:
            try:
                async with tls_lane(ready, roots, chain, key) as opened:
                    return await greet(opened, bare("arm"))
            except (grpc.aio.AioRpcError, AssertionError):
                return "no TLS"

        twin = make_intermediate(fleet, *make_root(fleet, now_ns=now_ns), now_ns=now_ns)  # the same names, other keys
        stranger = new_key()
        same = issue_robot(twin, stranger.public_key(), fleet=fleet, robot="arm", now_ns=now_ns, life_s=3600.0)
        assert await outcome(pem(same, twin.certificate), stranger) == "no TLS"
        assert await outcome(pem(same) + given["chain"], stranger) == "no TLS"
        mine, key = leaf_signed_by(held, fleet=fleet)
        assert await outcome(mine + given["chain"], key) == "no TLS"
        assert await outcome(given["certificate"], held.key) == "no TLS"  # without the issuer's certificate
        assert await outcome(given["certificate"] + given["chain"], stranger) == "no TLS"  # without its key
        over = dated(ready, held, begins_ns=now_ns - 2 * HOUR_NS, life_s=3600.0)
        soon = dated(ready, held, begins_ns=now_ns + HOUR_NS, life_s=3600.0)
        for one in (over, soon):
            assert await outcome(one.certificate + given["chain"], one.key) in ("no TLS", "certificate_expired")
        pair = issue_server(authority_of(ready), ["localhost"], now_ns=now_ns)
        server_key: Any = serialization.load_pem_private_key(pair.key_pem, password=None)
        assert await outcome(pair.chain_pem.decode(), server_key) in ("no TLS", "certificate_foreign")
        async with plain_lane(ready) as call:
            with pytest.raises(grpc.aio.AioRpcError):
                assert not await spoken(call)
        assert await outcome(given["certificate"] + given["chain"], held.key) == "welcome"


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion:DeprecationWarning")
async def test_old_tls_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on") as ready:
        ports = (ready.grpc_port, ready.http_port)
        for version, port in itertools.product((ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1), ports):
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            context.set_ciphers("ALL:@SECLEVEL=0")
            context.minimum_version = context.maximum_version = version
            with pytest.raises((ssl.SSLError, ConnectionError)):
                await asyncio.open_connection("127.0.0.1", port, ssl=context)


async def test_what_a_proxy_passes_on_is_not_local(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        for header in ("x-forwarded-for", "forwarded", "x-real-ip"):
            async with grpc.aio.insecure_channel(f"127.0.0.1:{ready.grpc_port}") as channel:
                call = link_pb2_grpc.LinkStub(channel).Connect(metadata=((header, "127.0.0.1"),))
                await call.write(link_pb2.AgentFrame(hello=bare("sim_1")))
                assert (await call.read()).goodbye.code == "not_enrolled", header
            async with lane(ready, "websocket", **{header: "127.0.0.1"}) as opened:
                assert await greet(opened, bare("sim_1")) == "not_enrolled", header


async def test_two_copies_at_the_same_time_raise_an_alarm(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, client(ready, key=ADMIN) as http:
        held, _ = await enrolled(ready)
        first, copy = held.hello(), held.hello()
        first.session_number, copy.session_id = 1000, b"c" * 16
        async with lane(ready, "grpc") as living:
            assert await greet(living, first, held) == "welcome"
            async with asyncio.timeout(60):
                while not await alarm(http, "arm"):
                    await living.send(heartbeat=link_pb2.Heartbeat(sent_ns=1))
                    copy.session_number += 1
                    async with lane(ready, "grpc") as opened:
                        assert await greet(opened, copy, held) == "fenced"
        assert "two agents" in await alarm(http, "arm")


async def test_what_happens_to_honest_robots_raises_none(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, client(ready, key=ADMIN) as http:
        held, _ = await enrolled(ready)
        number = 1000
        for process in (b"a", b"a", b"a", b"b", b"b", b"c"):  # quick reconnects, restarts
            hello = held.hello()
            hello.session_id, number = process * 16, number + 1
            hello.session_number = number
            for kind in KINDS:  # from one network to the other
                hello.session_number = number = number + 1
                async with lane(ready, kind) as opened:
                    assert await greet(opened, hello, held) == "welcome"
        async with lane(ready, "grpc") as dying:  # its network is gone: it says nothing any more
            hello.session_number = number = number + 1
            assert await greet(dying, hello, held) == "welcome"
            back = held.hello()
            back.session_id = b"d" * 16
            for early in range(5):  # restarted, with a clock that was set back
                back.session_number = early + 1
                async with lane(ready, "grpc") as opened:
                    assert await greet(opened, back, held) == "fenced"
        assert await alarm(http, "arm") == ""


async def test_a_stolen_name_is_of_no_use_without_certificates(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        held, _ = await enrolled(ready)
        for kind in KINDS:
            for hello, what in ((bare("arm"), "not_enrolled"), (held.hello(robot="leg"), "certificate_foreign")):
                async with lane(ready, kind) as opened:
                    assert await greet(opened, hello, held) == what
        await revoke(ready, "arm")
        for kind in KINDS:
            async with lane(ready, kind) as opened:
                assert await greet(opened, bare("arm"), held) == "not_enrolled"
            async with lane(ready, kind) as opened:
                assert await greet(opened, held.hello(), held) == "certificate_revoked"
