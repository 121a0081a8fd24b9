"""Signing in over HTTP, as a browser and as a program do it, against a real gateway."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from pathlib import Path

import httpx
import pytest
from websockets.exceptions import InvalidStatus

from gateway.api.models import identity as models
from gateway.main import Ready
from tests.gateway.harness import client, open_socket, running_gateway

PASSWORD = "correct horse battery"
JSON = {"Content-Type": "application/json"}


def local_key(ready: Ready) -> str:
    return (ready.data_dir / "local.key").read_text().strip()


class Browser:
    """Keeps its cookie and sends its token."""

    def __init__(self, ready: Ready) -> None:
        self.http = client(ready, key="")

    async def sign_in(self, path: str, **body: str) -> httpx.Response:
        answer = await self.http.post(f"/api/v1/auth/{path}", json=body)
        if answer.status_code == 200:
            self.http.headers["X-CSRF-Token"] = answer.json()["csrf"]
        return answer


Opened = Callable[[Ready], Browser]


@pytest.fixture
async def browsers() -> AsyncIterator[Opened]:
    made: list[Browser] = []

    def opened(ready: Ready) -> Browser:
        made.append(Browser(ready))
        return made[-1]

    yield opened
    for item in made:
        await item.http.aclose()


async def test_from_the_first_link_to_a_key_that_works(tmp_path: Path, browsers: Opened) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=local_key(ready)) as local:
        link = (await local.post("/api/v1/auth/links", json={})).json()
        models.SignInLink.model_validate(link)
        assert link["url"] == f"{ready.url}/signin#{link['token']}"
        page = browsers(ready)
        admin, answer = page.http, await page.sign_in("link", token=link["token"])
        assert answer.status_code == 200
        me = models.Account.model_validate(answer.json())
        assert (me.kind, me.name, me.role, "users.manage" in me.permissions) == ("user", "admin", "admin", True)
        assert (await admin.get("/api/v1/auth/me")).json() == answer.json()
        assert not me.has_password
        assert (await admin.post("/api/v1/auth/password", json={"old": "", "new": PASSWORD})).status_code == 200
        assert (await admin.get("/api/v1/auth/me")).json() == {**answer.json(), "has_password": True}
        again = await browsers(ready).sign_in("link", token=link["token"])
        assert (again.status_code, again.json()["code"]) == (401, "bad_credentials")
        body = {"name": "ci", "role": "operator", "scopes": ["lambda"], "expires_s": 3600}
        made = models.NewApiKey.model_validate((await admin.post("/api/v1/keys", json=body)).json())
        assert (made.user, made.key) == ("admin", f"mrk_{made.id}_{made.secret}")
        listed = await admin.get("/api/v1/keys")
        models.ApiKeyList.model_validate_json(listed.content)
        assert made.secret not in listed.text
        async with client(ready, key=made.key) as program:
            assert (await program.get("/api/v1/auth/me")).json()["scopes"] == ["lambda"]
            assert (await program.get("/api/v1/users")).json()["code"] == "forbidden"
            gone = await admin.request("DELETE", f"/api/v1/keys/{made.id}", headers=JSON, content=b"{}")
            assert gone.status_code == 200
            assert (await program.get("/api/v1/auth/me")).json()["code"] == "bad_credentials"


async def test_a_browser_signs_in_changes_its_password_and_signs_out(tmp_path: Path, browsers: Opened) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=local_key(ready)) as local:
        body = {"name": "ada", "role": "viewer", "robots": ["sim_*"], "password": PASSWORD}
        made = await local.post("/api/v1/users", json=body)
        assert (made.status_code, made.json()["has_password"]) == (201, True)
        assert "argon2" not in made.text
        one, two = browsers(ready), browsers(ready)
        ada, answer = one.http, await one.sign_in("login", name="ada", password=PASSWORD)
        other, _ = two.http, await two.sign_in("login", name="ada", password=PASSWORD)
        assert answer.status_code == 200
        cookie = answer.headers["set-cookie"]
        for part in ("metaros_session=", "HttpOnly", "SameSite=lax", "Path=/"):
            assert part in cookie
        assert "Secure" not in cookie  # or a browser would not send it to http://127.0.0.1
        assert (answer.json()["robots"], answer.json()["has_password"]) == (["sim_*"], True)
        change = {"old": PASSWORD, "new": "another horse battery"}
        token = ada.headers.pop("X-CSRF-Token")
        refused = await ada.post("/api/v1/auth/password", json=change)
        assert (refused.status_code, refused.json()["code"]) == (403, "csrf")
        ada.headers["X-CSRF-Token"] = token
        assert (await ada.post("/api/v1/auth/password", json=change)).status_code == 200
        assert (await ada.get("/api/v1/auth/me")).status_code == 200
        assert (await other.get("/api/v1/auth/me")).json()["code"] == "bad_credentials"
        assert "set-cookie" not in (await ada.post("/api/v1/auth/forget", json={})).headers, "hers is good"
        forgotten = await other.post("/api/v1/auth/forget", json={})
        assert (forgotten.status_code, "Max-Age=0" in forgotten.headers["set-cookie"]) == (200, True)
        assert (await other.get("/api/v1/auth/me")).json()["kind"] == "anonymous"
        left = await ada.post("/api/v1/auth/logout", json={})
        assert (left.status_code, "Max-Age=0" in left.headers["set-cookie"]) == (200, True)
        assert (await ada.get("/api/v1/auth/me")).json()["kind"] == "anonymous"


async def test_a_guesser_is_reported_nothing_but_to_wait(tmp_path: Path, browsers: Opened) -> None:
    async with running_gateway(tmp_path, sign_ins_per_min=0) as ready, client(ready, key=local_key(ready)) as local:
        await local.post("/api/v1/users", json={"name": "ada", "role": "viewer", "password": PASSWORD})
        said: dict[str, set[tuple[str, str]]] = {"ada": set(), "nobody": set()}
        for name, refusals in said.items():
            for _ in range(5):
                answer = await browsers(ready).sign_in("login", name=name, password="wrong")
                assert answer.status_code == 401
                refusals.add((answer.json()["code"], answer.json()["detail"]))
            while answer.status_code == 401:  # on a busy machine the first waits are over before the next try
                answer = await browsers(ready).sign_in("login", name=name, password="wrong")
            refusals.add((answer.json()["code"], answer.json()["detail"]))
            assert (answer.status_code, int(answer.headers["retry-after"]) >= 1) == (429, True)
            assert answer.json()["retry_after_s"] > 0
        assert said["ada"] == said["nobody"]
        assert {code for code, _ in said["ada"]} == {"bad_credentials", "too_many_requests"}


async def test_users_are_managed_and_somebody_stays(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=local_key(ready)) as local:
        for name, role in (("root", "admin"), ("ada", "operator")):
            assert (await local.post("/api/v1/users", json={"name": name, "role": role})).status_code == 201
        again = await local.post("/api/v1/users", json={"name": "ada", "role": "viewer"})
        assert (again.status_code, again.json()["code"]) == (409, "user_exists")
        listed = models.UserList.model_validate_json((await local.get("/api/v1/users")).content)
        assert [(user.name, user.role, user.has_password) for user in listed.users] == [
            ("ada", "operator", False),
            ("root", "admin", False),
        ]
        changed = await local.patch("/api/v1/users/ada", json={"role": "viewer", "robots": ["sim_1"]})
        assert (changed.json()["role"], changed.json()["robots"]) == ("viewer", ["sim_1"])
        for body in ({"disabled": True}, {"role": "viewer"}):
            last = await local.patch("/api/v1/users/root", json=body)
            assert (last.status_code, last.json()["code"]) == (409, "last_admin")
        for wrong in ({"role": "king"}, {"robots": ["a b"]}, {"password": "short"}, {"name": "x"}, {"role": "admin"}):
            assert (await local.patch("/api/v1/users/ada", json=wrong)).json()["code"] == "invalid_request", wrong
        assert (await local.patch("/api/v1/users/nobody", json={})).json()["code"] == "unknown_user"
        gone = await local.request("DELETE", "/api/v1/users/ada", headers=JSON, content=b"{}")
        assert gone.status_code == 200
        assert [user["name"] for user in (await local.get("/api/v1/users")).json()["users"]] == ["root"]


async def test_nobody_makes_a_key_or_a_password(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key="") as nobody:
        for path, body in (
            ("/api/v1/keys", {"name": "x", "role": "viewer"}),
            ("/api/v1/auth/password", {"old": "", "new": PASSWORD}),
            ("/api/v1/auth/links", {}),
        ):
            answer = await nobody.post(path, json=body)
            assert (answer.status_code, answer.json()["code"]) == (401, "sign_in"), path


async def test_a_key_of_the_store_opens_a_socket(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready, client(ready, key=local_key(ready)) as local:
        key = (await local.post("/api/v1/keys", json={"name": "ui", "role": "viewer"})).json()["key"]
        async with open_socket(ready, "/api/v1/stream", key=key):
            pass
        with pytest.raises(InvalidStatus) as refused:
            async with open_socket(ready, "/api/v1/stream", key=key[:-1] + "x"):
                pass
        assert refused.value.response.status_code == 401
