"""Notices on a real store, to real receivers: what comes, when, once, after failures and restarts."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from email import message_from_bytes, policy
from pathlib import Path
from typing import Any

import pytest

from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.errors import UnknownRouteError
from gateway.alerting.alerts.notices import service
from gateway.alerting.alerts.notices.route import Mailbox, Route
from gateway.alerting.alerts.notices.service import Notices, RouteState
from gateway.outbound.webhook import Webhook, signature
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.alerting.alerts.findings import NOW, S, cleared, edge, opened
from tests.gateway.alerting.alerts.world import World, open_world
from tests.support.servers.certificates import make_certificate
from tests.support.servers.databases import on_both
from tests.support.servers.receivers import (
    HttpReceiver,
    SmtpReceiver,
    http_receiver,
    server_context,
    smtp_receiver,
)
from tests.support.waiting import wait_until_async

UNAVAILABLE = b"HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n"


def hook(receiver: HttpReceiver, **more: Any) -> Route:
    """A route to it that waits for nothing."""
    return Route(**{"name": "ops", "wait_s": 0, **more, "to": webhook(receiver)})


def webhook(receiver: HttpReceiver, **more: Any) -> Webhook:
    """Where it listens."""
    return Webhook(**{"url": f"http://localhost:{receiver.port}/x?key=1", "private": True, **more})


def mailbox(receiver: SmtpReceiver, **more: Any) -> Mailbox:
    """Where it listens, without TLS unless said otherwise."""
    fields: dict[str, Any] = {"host": "localhost", "port": receiver.port, "tls": "off", "private": True}
    return Mailbox(sender="robots@example.org", to=("ann@example.org",), **{**fields, **more})


@asynccontextmanager
async def notices(world: World, *routes: Route, **limits: Any) -> AsyncIterator[Notices]:
    """Notices of a world, started and closed."""
    made = Notices(world.manager, world.store, routes=routes, clock=world.clock, limits=replace(LIMITS, **limits))
    await made.start()
    try:
        yield made
    finally:
        await made.close()


@on_both
async def test_an_alert_is_reported_from_its_beginning_to_its_end(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world, http_receiver() as receiver:
        route = replace(hook(receiver, wait_s=10), link="https://fleet.example.org/")
        async with notices(world, route) as reported:
            await world.report(opened())
            await reported.send_due("ops")
            assert receiver.requests == []  # it may be explained by another yet
            await world.step(10)
            await reported.send_due("ops")
            await reported.send_due("ops")
            assert receiver.types == ["opened"]
            alert = world.alert()
            await world.manager.acknowledge(alert.id, by="eve")
            await reported.send_due("ops")
            await world.report(cleared())
            await world.step(30)
            await reported.send_due("ops")
            assert receiver.types == ["opened", "acknowledged", "resolved"]
            (state,) = reported.routes()
            assert (state.sent, state.failed, state.waiting, state.last_error) == (3, 0, 0, "")
        first = receiver.documents[0]
        assert first["specversion"] == "1.0"
        assert (first["type"], first["source"], first["subject"]) == ("metaros.alert.opened", "/api/v1/robots/r1", "r1")
        assert first["data"]["alert"] == alert.id
        assert (first["data"]["reason"], first["data"]["high"]) == (alert.reason, 80.0)
        assert first["data"]["url"].startswith("https://fleet.example.org/robots/r1?t=2023-11-14T22:13:20.000Z")
        assert len({item["id"] for item in receiver.documents}) == 3


async def test_a_webhook_is_signed_and_says_who_it_is(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        to = webhook(receiver, secret=b"swordfish", token="abc")
        async with notices(world, Route(name="ops", to=to, wait_s=0)) as reported:
            await world.report(opened())
            await reported.send_due("ops")
    ((line, headers, body),) = receiver.requests
    assert line == "POST /x?key=1 HTTP/1.1"
    assert headers["content-type"] == "application/cloudevents+json"
    assert headers["authorization"] == "Bearer abc"
    at_s = int(headers["webhook-timestamp"])
    assert at_s == NOW // S
    assert headers["webhook-signature"] == signature(b"swordfish", body, message=headers["webhook-id"], at_s=at_s)


def test_the_signature_is_that_of_standard_webhooks() -> None:
    # The example of the specification: https://github.com/standard-webhooks/standard-webhooks
    secret = bytes.fromhex("30bb7ba1ce5ee5ebc6ac1f77bd1e2d12e6a8a9a83ed19d0b")
    made = signature(secret, b'{"a":1}', message="msg_1", at_s=1_614_265_330)
    assert made.startswith("v1,")
    assert len(made) == 3 + 44


async def test_what_is_quiet_is_not_reported_until_it_is_loud(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        async with notices(world, hook(receiver)) as reported:
            await world.report(opened(cause="offline", series=""), opened(cause="silence", series="/scan"))
            await reported.send_due("ops")
            assert [item["data"]["cause"] for item in receiver.documents] == ["offline"]
            await world.report(cleared(cause="offline", series=""))
            await world.step(30)
            await reported.send_due("ops")
            causes = [(item["data"]["cause"], item["data"]["state"]) for item in receiver.documents[1:]]
            assert sorted(causes) == [("offline", "resolved"), ("silence", "open")]


async def test_what_was_quiet_to_its_end_is_never_reported(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        async with notices(world, hook(receiver)) as reported:
            await world.manager.add_silence(until_ns=NOW + 9000 * S, by="eve")
            await world.report(opened())
            await reported.send_due("ops")
            await world.report(cleared())
            await world.step(30)
            await reported.send_due("ops")
            assert receiver.requests == []


async def test_it_is_reported_again_when_it_gets_worse_goes_on_or_comes_back(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        async with notices(world, hook(receiver, again_s=300, repeat_s=3600)) as reported:
            await world.report(opened())
            await reported.send_due("ops")
            world.clock.advance(1)
            await world.report(edge("changed", severity="error"))
            await reported.send_due("ops")
            assert [item["data"]["severity"] for item in receiver.documents] == ["warning", "error"]
            await world.step(3600)
            await reported.send_due("ops")
            assert receiver.types == ["opened"] * 3
            await world.report(cleared())
            await world.step(30)
            await reported.send_due("ops")
            for _ in range(3):  # it flaps
                await world.report(opened())
                await reported.send_due("ops")
                await world.report(cleared())
                await world.step(30)
                await reported.send_due("ops")
            assert receiver.types == ["opened"] * 3 + ["resolved"]
            await world.report(opened())
            await world.step(300)
            await reported.send_due("ops")
            assert receiver.types == ["opened"] * 3 + ["resolved", "opened"]
            assert receiver.documents[-1]["data"]["times"] == 5
            assert len({item["id"] for item in receiver.documents}) == 5


async def test_what_fails_is_tried_again_more_and_more_seldom_and_comes_in_order(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers = [UNAVAILABLE] * 3
        async with notices(world, hook(receiver)) as reported:
            await world.report(opened(), opened("r2"))
            for seconds in (0, 0.9, 0.1, 1.9, 0.1, 3.9, 0.1):
                world.clock.advance(seconds)
                await reported.send_due("ops")
            assert receiver.types == ["opened"] * 5  # three times in vain, then both
            (state,) = reported.routes()
            assert (state.sent, state.failed, state.last_error) == (2, 3, "")
            assert receiver.documents[0]["id"] == receiver.documents[3]["id"]


async def test_what_ended_while_the_receiver_was_away_is_reported_all_the_same(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers = [UNAVAILABLE]
        async with notices(world, hook(receiver)) as reported:
            await world.report(opened())
            await reported.send_due("ops")
            await world.report(cleared())
            receiver.answers = [UNAVAILABLE] * 9
            for seconds in (30, 700, 1):  # it is out of the registry by then
                await world.step(seconds)
                await reported.send_due("ops")
            receiver.answers.clear()
            receiver.requests.clear()
            world.clock.advance(300)
            assert list(world.manager.known()) == []
            await reported.send_due("ops")
            await reported.send_due("ops")
            assert receiver.types == ["opened", "resolved"]
            await reported.send_due("ops")
            assert len(receiver.requests) == 2


async def test_what_fails_for_too_long_is_given_up(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers = [UNAVAILABLE] * 2
        async with notices(world, hook(receiver), notice_tries_s=100) as reported:
            await world.report(opened())
            await reported.send_due("ops")
            world.clock.advance(101)
            await reported.send_due("ops")
            world.clock.advance(101)
            await reported.send_due("ops")
            assert len(receiver.requests) == 2
            assert "1 notices of route ops are given up: the receiver answers 503" in caplog.text


async def test_what_waits_for_a_receiver_is_bounded(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers = [UNAVAILABLE] * 5
        async with notices(world, hook(receiver), notices_waiting=1) as reported:
            for number in range(2):
                await world.report(opened(f"r{number}"))
            for _ in range(8):
                await reported.send_due("ops")
                world.clock.advance(400)
            assert reported.routes()[0].waiting == 0


@on_both
async def test_a_restart_tells_nothing_twice_and_forgets_nothing(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with http_receiver() as receiver:
        route = hook(receiver)
        async with open_world(tmp_path, url=store_url, clock=clock) as world:
            async with notices(world, route) as reported:
                await world.report(opened(), opened("r2"))
                await reported.send_due("ops")
            await world.report(cleared("r2"))
            await world.step(30)
        clock.advance(700)
        async with open_world(tmp_path, url=store_url, clock=clock) as world, notices(world, route) as reported:
            await reported.send_due("ops")
            await reported.send_due("ops")
            assert receiver.types == ["opened", "opened", "resolved"]
            assert receiver.documents[-1]["data"]["robot"] == "r2"
        async with open_world(tmp_path, url=store_url, clock=clock) as world, notices(world, route) as reported:
            await reported.send_due("ops")
            assert len(receiver.requests) == 3


async def test_of_two_gateways_one_sends_and_the_other_goes_on(tmp_path: Path, shared_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with (
        http_receiver() as receiver,
        open_world(tmp_path, url=shared_url, clock=clock, name="g1") as one,
        open_world(tmp_path, url=shared_url, clock=clock, name="g2") as two,
        notices(one, hook(receiver)) as first,
        notices(two, hook(receiver)) as second,
    ):
        await two.report(opened())
        await one.manager.refresh()
        await first.send_due("ops")
        await second.send_due("ops")
        assert receiver.types == ["opened"]
        clock.advance(16)
        assert await second.take_leadership()
        assert not await first.take_leadership()
        await two.report(cleared())
        await two.step(30)
        await one.manager.refresh()
        await first.send_due("ops")
        await second.send_due("ops")
        assert receiver.types == ["opened", "resolved"]


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (b"HTTP/1.1 302 Found\r\nLocation: http://10.0.0.1/\r\n\r\n", "the receiver answers 302"),
        (b"HTTP/1.1 500 Oh\r\n\r\n", "the receiver answers 500"),
        (b"220 not http\r\n\r\n", "illegal status line"),
        (b"HTTP/1.1 200 OK\r\nx: " + b"y" * 100_000, "Receive buffer too long"),
        (b"", "the receiver ended the connection early"),
    ],
)
async def test_answers_that_are_no_yes(tmp_path: Path, answer: bytes, error: str) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.answers = [answer]
        async with notices(world, hook(receiver)) as reported:
            done = await reported.test("ops", by="eve")
            assert not done.ok
            assert error in done.error


async def test_a_receiver_that_says_nothing_holds_nobody_up_for_long(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        receiver.silent = True
        async with notices(world, hook(receiver), notice_s=0.05) as reported:
            done = await reported.test("ops", by="eve")
            assert (done.ok, done.status, done.error) == (False, 0, "no answer in 0.05 s")


async def test_a_route_into_a_private_network_that_does_not_say_so(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver:
        route = Route(name="ops", to=webhook(receiver, private=False))
        async with notices(world, route) as reported:
            done = await reported.test("ops", by="eve")
            assert "private = true lets notices go" in done.error
            assert receiver.requests == []


async def test_a_test_says_that_it_is_one(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, http_receiver() as receiver, smtp_receiver() as post:
        routes = hook(receiver), Route(name="mail", to=mailbox(post))
        async with notices(world, *routes) as reported:
            done = await reported.test("ops", by="eve")
            assert (done.ok, done.status, done.error) == (True, 204, "")
            assert (await reported.test("mail", by="eve")).ok
            with pytest.raises(UnknownRouteError):
                await reported.test("nobody", by="eve")
    assert receiver.documents[0]["type"] == "metaros.alert.test"
    assert b"This is a test by eve" in post.mails[0][2]


async def test_tls_is_verified(tmp_path: Path) -> None:
    server = server_context(make_certificate(tmp_path))
    ours = ssl.create_default_context(cafile=tmp_path / "localhost.pem")
    async with open_world(tmp_path) as world, http_receiver(server) as receiver:
        good = webhook(receiver, url=f"https://localhost:{receiver.port}/", context=ours)
        routes = (
            Route(name="good", to=good),
            Route(name="unknown", to=replace(good, context=None)),
            Route(name="other", to=replace(good, url=f"https://127.0.0.1:{receiver.port}/")),
        )
        async with notices(world, *routes) as reported:
            assert (await reported.test("good", by="eve")).ok
            for name in ("unknown", "other"):
                done = await reported.test(name, by="eve")
                assert "certificate verify failed" in done.error
    assert len(receiver.requests) == 1


async def test_alerts_of_a_moment_are_one_mail(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, smtp_receiver() as post:
        route = Route(name="mail", to=mailbox(post), wait_s=0, link="https://fleet.example.org")
        async with notices(world, route, notice_alerts=2) as reported:
            await world.report(opened(reason="zu heiß\r\nBcc: x@y\n.\n."))
            world.clock.advance(1)  # the ids of one moment are in no order
            await world.report(opened("r2"), opened("r3"))
            await reported.send_due("mail")
            assert reported.routes()[0].sent == 3
    assert [(sender, to) for sender, to, _ in post.mails] == [("<robots@example.org>", ["<ann@example.org>"])] * 2
    mail = message_from_bytes(post.mails[0][2], policy=policy.default)
    assert mail["Subject"].startswith("[Meta-ROS] warning: r")
    assert mail["Subject"].endswith("Too hot and 1 more")
    assert mail["Bcc"] is None
    assert (mail["To"], mail["Auto-Submitted"]) == ("ann@example.org", "auto-generated")
    words = mail.get_content()
    assert "zu heiß  Bcc: x@y . ." in words
    assert "https://fleet.example.org/robots/r1?t=" in words


async def test_mail_says_who_acknowledged_and_that_it_is_over(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world, smtp_receiver() as post:
        async with notices(world, Route(name="mail", to=mailbox(post), wait_s=0)) as reported:
            await world.report(opened())
            await reported.send_due("mail")
            await world.manager.acknowledge(world.alert().id, by="eve")
            await reported.send_due("mail")
            await world.manager.resolve(world.alert().id, by="bob")
            await reported.send_due("mail")
    mails = [message_from_bytes(mail, policy=policy.default) for _, _, mail in post.mails]
    assert [mail["Subject"].split(": ")[0] for mail in mails[1:]] == ["[Meta-ROS] acknowledged", "[Meta-ROS] resolved"]
    assert "acknowledged by eve" in mails[1].get_content()
    assert "by bob" in mails[2].get_content()


@pytest.mark.parametrize("ways", ["PLAIN LOGIN", "LOGIN"])
@pytest.mark.parametrize("tls", ["starttls", "tls"])
async def test_mail_over_tls_with_a_password(tmp_path: Path, tls: str, ways: str) -> None:
    server = server_context(make_certificate(tmp_path))
    ours = ssl.create_default_context(cafile=tmp_path / "localhost.pem")
    chosen: dict[str, Any] = {"starttls": server} if tls == "starttls" else {"wrapped": server}
    async with open_world(tmp_path) as world, smtp_receiver(**chosen) as post:
        post.ways = ways
        to = mailbox(post, tls=tls, user="me", password="pässword", context=ours)
        async with notices(world, Route(name="mail", to=to)) as reported:
            assert (await reported.test("mail", by="eve")).ok
    assert b"".join(post.signed_in).replace(b"\0", b"") == "mepässword".encode()
    assert len(post.mails) == 1


async def test_mail_that_is_not_verified_or_cannot_be_secured_is_not_sent(tmp_path: Path) -> None:
    server = server_context(make_certificate(tmp_path))
    async with open_world(tmp_path) as world, smtp_receiver(starttls=server) as post, smtp_receiver() as plain:
        routes: Sequence[Route] = (
            Route(name="unknown", to=mailbox(post, tls="starttls")),
            Route(name="plain", to=mailbox(plain, tls="starttls")),
        )
        async with notices(world, *routes) as reported:
            assert "certificate verify failed" in (await reported.test("unknown", by="eve")).error
            assert (await reported.test("plain", by="eve")).error == "the server does not offer STARTTLS"
    assert post.mails == plain.mails == []


async def test_what_somebody_puts_before_the_handshake_is_forgotten(tmp_path: Path) -> None:
    server = server_context(make_certificate(tmp_path))
    ours = ssl.create_default_context(cafile=tmp_path / "localhost.pem")
    async with open_world(tmp_path) as world, smtp_receiver(starttls=server) as post:
        post.injected = b"250 AUTH PLAIN\r\n"
        async with notices(world, Route(name="mail", to=mailbox(post, tls="starttls", context=ours))) as reported:
            done = await reported.test("mail", by="eve")
    assert done.ok or post.mails == []  # never mail that somebody else had a word in


@pytest.mark.parametrize(
    ("refuse", "error", "mails"),
    [
        ({"MAIL": "550 no"}, "the server says '550 no'", 0),
        ({"RCPT TO:<ann@example.org>": "550 unknown"}, "", 1),
        ({"RCPT": "550 unknown"}, "the server says '550 unknown'", 0),
        ({"DATA": "451 later"}, "the server says '451 later'", 0),
        ({"EHLO": "hello"}, "the server says 'hello'", 0),
        ({"EHLO": "x" * 9000}, "the server ended the connection, or says too much", 0),
        ({"EHLO": "250-x\r\n" * 200}, "the server says too much", 0),
    ],
)
async def test_a_mail_server_that_refuses(tmp_path: Path, refuse: dict[str, str], error: str, mails: int) -> None:
    async with open_world(tmp_path) as world, smtp_receiver() as post:
        post.refuse = refuse
        to = replace(mailbox(post), to=("ann@example.org", "bob@example.org"))
        async with notices(world, Route(name="mail", to=to)) as reported:
            done = await reported.test("mail", by="eve")
            assert (done.ok, done.error, len(post.mails)) == (not error, error, mails)


async def test_it_runs_by_itself_and_without_routes_there_is_nothing_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "LOOK_S", 0.01)
    config = AlertConfig(tick_s=0.01)
    async with open_world(tmp_path, run=True, config=config) as world, http_receiver() as receiver:
        async with notices(world) as idle:
            await idle.run()
            assert idle.routes() == []
        async with notices(world, hook(receiver)) as reported:
            running = asyncio.create_task(reported.run())
            world.manager.report([opened()])
            await wait_until_async(lambda: reported.routes()[0].sent)  # the receiver has it before that is known here
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            assert receiver.types == ["opened"]
            assert reported.routes()[0] == RouteState(
                name="ops",
                kind="webhook",
                target=f"http://localhost:{receiver.port}/…",
                severity="warning",
                robots=(),
                causes=(),
                sent=1,
                last_ns=NOW,
            )
