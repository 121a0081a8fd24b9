"""How often somebody may ask: who is counted, what is counted, and what a refusal says."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from gateway.api.middleware.authenticate import Authenticate
from gateway.api.middleware.rate import RATES, RateLimited, Rates
from gateway.domain.principal import NOBODY, Principal, Role
from gateway.errors import TooManyRequestsError
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.harness import ScriptedAgent, client, flood, hear, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing

ADA = Principal(kind="user", id="u1", name="ada")


async def answer(app: Any, **scope: Any) -> tuple[int, dict[str, str]]:
    """The status and headers of one request."""
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    asked = {"type": "http", "path": "/api/v1/robots", "client": ("10.0.0.1", 1), "headers": [], "method": "GET"}
    await app({**asked, "metaros.principal": NOBODY, **scope}, None, send)
    return sent[0]["status"], {key.decode(): value.decode() for key, value in sent[0]["headers"]}


def limited(clock: ManualClock, **per_s: Any) -> RateLimited:
    """An application that says 200 behind these rates."""

    async def app(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    return RateLimited(app, Rates(clock=clock, **per_s))


async def test_each_is_counted_for_themselves_and_may_come_back_when_reported() -> None:
    clock = ManualClock()
    app = limited(clock, anonymous=1.0, requests=2.0)
    statuses = [(await answer(app))[0] for _ in range(6)]
    assert statuses == [200] * 5 + [429]
    _, headers = await answer(app)
    assert (headers["retry-after"], headers["content-type"]) == ("1", "application/problem+json")
    for other in (("10.0.0.2", 1), ("2001:db8::1", 1)):
        assert (await answer(app, client=other))[0] == 200
    assert (await answer(app, **{"metaros.principal": ADA}))[0] == 200
    clock.advance(1.0)
    assert (await answer(app))[0] == 200
    assert (await answer(app))[0] == 429


async def test_an_ipv6_network_is_one_address_and_probes_always_pass() -> None:
    app = limited(ManualClock(), anonymous=0.2)
    assert (await answer(app, client=("2001:db8::1", 1)))[0] == 200
    assert (await answer(app, client=("2001:db8::ffff:2", 1)))[0] == 429
    assert (await answer(app, client=("2001:db8:0:1::1", 1)))[0] == 200
    for path in ("/healthz", "/readyz"):
        assert (await answer(app, client=("2001:db8::1", 1), path=path))[0] == 200


def test_every_row_can_be_turned_off_and_scaled() -> None:
    none: dict[str, Any] = {row.name: 0.0 for row in RATES}
    off = Rates(clock=ManualClock(), **none)
    for row in RATES:
        for _ in range(100):
            off.take(row.name, "x", row.burst)
    slow = Rates(clock=ManualClock(), robot=1.0)
    for _ in range(5):
        slow.take("robot", "sim_1")
    with pytest.raises(TooManyRequestsError) as refused:
        slow.take("robot", "sim_1")
    assert refused.value.retry_after_s == 1.0


async def test_failed_sign_ins_count_by_address_and_good_ones_do_not(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, sign_ins_per_min=0.01) as ready, client(ready, key="") as http:
        admin = (ready.data_dir / "local.key").read_text().strip()
        made = {"name": "ada", "role": "viewer", "robots": ["*"], "password": "correct horse battery"}
        async with client(ready, key=admin) as owner:
            assert (await owner.post("/api/v1/users", json=made)).status_code == 201
        good = {"name": "ada", "password": "correct horse battery"}
        for _ in range(3):
            assert (await http.post("/api/v1/auth/login", json=good)).status_code == 200
        codes = []
        for number in range(3):  # other names each time: the lock-out by name never sees them
            refused = await http.post("/api/v1/auth/link", json={"token": f"wrong{number}"})
            codes.append(refused.status_code)
        assert codes == [401, 429, 429]
        assert 1 <= int(refused.headers["retry-after"]) <= 6000
        assert refused.json()["code"] == "too_many_requests"
        assert (await http.post("/api/v1/auth/login", json=good)).status_code == 429
        assert (await http.get("/api/v1/robots")).status_code == 200


async def test_credentials_that_are_not_good_run_out_before_the_store_is_asked() -> None:
    asked = 0

    class Counting(KeyRing):
        async def by_key(self, text: str) -> Principal | None:
            nonlocal asked
            asked += 1
            return await super().by_key(text)

    async def app(*_: Any) -> None: ...

    ring = Counting()
    known = Authenticate(app, ring, anonymous=True, rates=Rates(clock=ManualClock(), refused=1.0))

    async def refusal(address: str, key: str) -> Any:
        headers = [(b"host", b"localhost"), (b"authorization", f"Bearer {key}".encode())]
        scope: dict[str, Any] = {"type": "http", "path": "/api/v1/robots", "client": (address, 1), "headers": headers}
        await known(scope, None, None)  # type: ignore[arg-type]
        return scope.get("metaros.refusal")

    codes = [(await refusal("10.0.0.1", "mrk_none_such")).code for _ in range(12)]
    assert codes == ["bad_credentials"] * 10 + ["too_many_requests"] * 2
    assert asked == 10
    good = ring.add(role=Role.VIEWER, name="v")
    assert await refusal("10.0.0.2", good) is None


async def test_what_changes_a_robot_is_bounded_for_everybody_together(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, robot_requests_per_s=0.01) as ready, client(ready) as http:
        path, body = "/api/v1/robots/sim_1/uplink", {"bytes_per_s": 5000}
        codes = [(await http.put(path, json=body)).status_code for _ in range(3)]
        assert codes[0] == 404
        assert codes[1:] == [429, 429]
        assert (await http.put("/api/v1/robots/sim_2/uplink", json=body)).status_code == 404
        assert (await http.get("/api/v1/robots")).status_code == 200


async def test_a_client_that_floods_its_socket_is_shown_out_and_a_driver_is_not(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready), open_socket(ready, "/api/v1/stream") as socket:
        await hear(socket, "welcome")
        hearing = asyncio.create_task(hear(socket, "nothing"))
        with pytest.raises(ConnectionClosed) as closed:
            await flood(socket, op="unsubscribe", id=1)
        await asyncio.wait({hearing})
        assert isinstance(hearing.exception(), ConnectionClosed)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code in (1008, 4429)  # whichever of frames and messages was too many first
        async with open_socket(ready, "/api/v1/robots/sim_1/teleop") as wheel:
            for _ in range(250):  # five seconds at 50 Hz
                await say(wheel, op="drive", linear=0.1, angular=0.0)
                assert (await hear(wheel, "error"))["code"] == "invalid_request"


async def test_sockets_that_are_open_are_bounded_and_come_free(tmp_path: Path) -> None:
    clock = ManualClock()
    rates = Rates(clock=clock)
    rates.open["10.0.0.1"] = LIMITS.sockets_open

    async def app(_scope: Any, _receive: Any, _send: Any) -> None:
        assert rates.open["10.0.0.2"] == 1

    limited_app = RateLimited(app, rates)
    path = {"type": "websocket", "path": "/api/v1/stream", "extensions": {"websocket.http.response": {}}}
    assert (await answer(limited_app, **path))[0] == 429
    scope = {**path, "client": ("10.0.0.2", 1), "headers": [], "metaros.principal": NOBODY}

    async def never(*_message: Any) -> Any:
        raise AssertionError

    await limited_app(scope, never, never)
    assert "10.0.0.2" not in rates.open


async def test_sockets_are_opened_at_a_rate(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, requests_per_s=0.001) as ready:
        async with open_socket(ready, "/api/v1/stream"):
            pass
        with pytest.raises(InvalidStatus) as refused:
            async with open_socket(ready, "/api/v1/stream"):
                pass
        assert refused.value.response.status_code == 429
        assert int(refused.value.response.headers["Retry-After"]) >= 1
