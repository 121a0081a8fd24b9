"""The endpoints of accounts over HTTP, tried by a stranger: planted cookies, forged requests, names that look alike."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.main import Ready
from tests.gateway.harness import client, running_gateway
from tests.support.gateways.plain_http import FREE
from tests.support.gateways.quick_passwords import quick_passwords  # noqa: F401 - a fixture

pytestmark = pytest.mark.usefixtures("quick_passwords")
PASSWORD = "correct horse battery"


def local(ready: Ready) -> httpx.AsyncClient:
    """A client with the key of the data directory."""
    return client(ready, key=(ready.data_dir / "local.key").read_text().strip())


async def user(ready: Ready, name: str, role: str, *robots: str) -> None:
    """A new one with PASSWORD."""
    wanted = {"name": name, "role": role, "robots": robots or ["*"], "password": PASSWORD}
    async with local(ready) as http:
        assert (await http.post("/api/v1/users", json=wanted)).status_code == 201


@asynccontextmanager
async def signed_in(ready: Ready, name: str, **headers: str) -> AsyncIterator[httpx.AsyncClient]:
    """A browser of that user's, which sends its token."""
    async with client(ready, key="", **headers) as http:
        answer = await http.post("/api/v1/auth/login", json={"name": name, "password": PASSWORD})
        assert answer.status_code == 200, answer.text
        http.headers["X-CSRF-Token"] = answer.json()["csrf"]
        yield http


async def test_a_planted_cookie_is_nobody_s_session(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, **FREE) as ready:
        await user(ready, "ada", "operator")
        planted = "0" * 64
        async with signed_in(ready, "ada", Cookie=f"metaros_session={planted}") as ada:
            assert ada.cookies["metaros_session"] != planted
        async with client(ready, key="", Cookie=f"metaros_session={planted}") as eve:
            assert (await eve.get("/api/v1/auth/me")).status_code == 401


async def test_a_page_of_somebody_else_s_signs_nobody_in(tmp_path: Path) -> None:
    body = b'{"name": "ada", "password": "correct horse battery"}'
    async with running_gateway(tmp_path, **FREE) as ready, client(ready, key="") as http:
        await user(ready, "ada", "operator")
        forged: list[tuple[int, dict[str, str]]] = [
            (403, {"Content-Type": "application/json", "Origin": "https://evil.example"}),
            (403, {"Content-Type": "application/json", "Origin": "null"}),
            (415, {"Content-Type": "text/plain", "Origin": ready.url}),
            (415, {"Content-Type": "text/plain; x=application/json", "Origin": ready.url}),
            (415, {"Content-Type": "application/x-www-form-urlencoded"}),
            (415, {"Content-Type": "application/json, text/plain"}),
        ]
        for status, headers in forged:
            answer = await http.post("/api/v1/auth/login", content=body, headers=headers)
            assert (answer.status_code, "set-cookie" in answer.headers) == (status, False), headers


async def test_a_key_beside_a_cookie_is_what_counts(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, **FREE) as ready:
        await user(ready, "ada", "admin")
        async with signed_in(ready, "ada") as ada:
            wanted = {"name": "k", "role": "viewer"}
            viewer = (await ada.post("/api/v1/keys", json=wanted)).json()["key"]
            no_token = {"X-CSRF-Token": ""}
            assert (await ada.get("/api/v1/users")).status_code == 200
            assert (await ada.post("/api/v1/keys", json=wanted, headers=no_token)).json()["code"] == "csrf"
            for key, code in ((viewer, "forbidden"), (viewer[:-1] + "x", "bad_credentials")):
                bearer = {"Authorization": f"Bearer {key}", **no_token}
                assert (await ada.get("/api/v1/users", headers=bearer)).json()["code"] == code


async def test_nobody_makes_more_of_themselves(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, **FREE) as ready:
        await user(ready, "ada", "operator", "sim_*")
        async with signed_in(ready, "ada") as ada:
            wanted: list[dict[str, Any]] = [
                {"role": "admin", "robots": ["*"]},
                {"role": "operator", "robots": ["*"]},
                {"role": "operator", "robots": ["**"]},
                {"role": "viewer", "robots": ["s*"]},
                {"role": "viewer", "robots": ["sim_*", "arm"]},
                {"role": "viewer", "robots": ["*_*"], "scopes": ["lambda"]},
            ]
            for one in wanted:
                answer = await ada.post("/api/v1/keys", json={"name": "k", **one})
                assert answer.json()["code"] in ("forbidden", "invalid_request"), one
                assert answer.status_code in (400, 403)
            for change in ({"role": "admin"}, {"robots": ["*"]}):
                assert (await ada.patch("/api/v1/users/ada", json=change)).json()["code"] == "forbidden"
            assert (await ada.post("/api/v1/auth/links", json={"name": "ada"})).json()["code"] == "forbidden"
            made = (await ada.post("/api/v1/keys", json={"name": "k", "role": "operator", "robots": ["sim_*"]})).json()
        async with client(ready, key=made["key"]) as program:
            again = await program.post("/api/v1/keys", json={"name": "k", "role": "viewer", "robots": ["sim_*"]})
            assert again.json()["code"] == "forbidden", "a key makes no key"
            assert (await program.get("/api/v1/keys")).json()["keys"] == []
            assert (await program.delete(f"/api/v1/keys/{made['id']}")).json()["code"] == "unknown_key"
            nobody = await program.post("/api/v1/auth/password", json={"old": PASSWORD, "new": PASSWORD * 2})
            assert nobody.json()["code"] == "forbidden"


async def test_a_name_that_looks_alike_is_another_and_gives_no_more_guesses(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, **FREE) as ready, client(ready, key="") as http:
        await user(ready, "ada", "operator")
        wrong = await http.post("/api/v1/auth/login", json={"name": "ada", "password": "x" * 12})
        for name in ("Ada", " ada", "ada\n", "ada\u200b", "\uff41da", "ad\u0301a"):
            answer = await http.post("/api/v1/auth/login", json={"name": name, "password": PASSWORD})
            assert (answer.status_code, answer.json()["code"]) == (401, "bad_credentials"), ascii(name)
            assert answer.json() == wrong.json(), "and nobody is told which it was"


async def test_a_whole_key_in_an_address_does_not_stay_in_the_log(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, **FREE) as ready, local(ready) as http:
        made = (await http.post("/api/v1/keys", json={"name": "k", "role": "viewer"})).json()
        token = (await http.post("/api/v1/enrolment-tokens", json={})).json()
        await http.delete(f"/api/v1/keys/{made['key']}")
        await http.delete(f"/api/v1/enrolment-tokens/{token['token']}")
        await http.delete("/api/v1/keys/%1B%5B2J%0D%0Aforged")
        text = (await http.get("/api/v1/audit")).text
        assert made["id"] in text
        for secret in (made["secret"], made["key"], token["token"], token["token"].rpartition(".")[2]):
            assert secret not in text
        assert "\\u001b" not in text
        assert "\\r" not in text
