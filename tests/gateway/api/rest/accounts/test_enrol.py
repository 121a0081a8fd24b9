"""Enrolment over HTTP: two commands' worth of requests, every refusal by its code, tokens for whom they are."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import httpx

from gateway.domain.principal import Role
from gateway.identity.certificates.parsing import load_certificate, pin, robot_uri
from metaros.link.proof import renew_statement, sign
from tests.gateway.harness import client, running_gateway
from tests.gateway.identity.robot_keys import ask, der, new_key
from tests.support.gateways.memory_authenticator import KeyRing

API = "/api/v1"


def b64(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


async def token(http: httpx.AsyncClient, **order: Any) -> dict[str, Any]:
    """A new token's document."""
    answer = await http.post(f"{API}/enrolment-tokens", json=order)
    assert answer.status_code == 201, answer.text
    return dict(answer.json())


async def post(http: httpx.AsyncClient, path: str, **body: Any) -> tuple[int, dict[str, Any]]:
    """A request's status and answer."""
    answer = await http.post(f"{API}{path}", json=body)
    return answer.status_code, dict(answer.json())


async def test_a_robot_enrols_and_renews(tmp_path: Path) -> None:
    ring = KeyRing()
    admin = ring.add(role=Role.ADMIN, name="ada")
    async with running_gateway(tmp_path, authenticator=ring) as ready, client(ready, key=admin) as people:
        made = await token(people, robot="arm")
        assert made["command"] == f"metaros agent enrol {made['token']} --gateway {ready.url} --name arm"
        async with client(ready, key="") as http:
            roots = (await http.get(f"{API}/enrol/roots")).json()
            assert roots["pins"] == [made["token"].rpartition(".")[2]] == [pin(load_certificate(roots["roots"]))]
            key = new_key()
            csr = ask(key, uri=robot_uri(roots["fleet"], "arm"))
            status, given = await post(http, "/enrol", token=made["token"], robot="arm", csr=csr)
            assert (status, given["robot"], given["grpc_port"], given["grpc_tls"]) == (
                201,
                "arm",
                ready.grpc_port,
                False,
            )
            assert (await post(http, "/enrol", token=made["token"], robot="arm", csr=csr))[0] == 200
            asked = (await post(http, "/enrol/challenge", robot="arm"))[1]
            nonce = base64.urlsafe_b64decode(asked["nonce"] + "=")
            fresh = ask(new_key())
            statement = renew_statement(nonce, audience=asked["audience"], robot_id="arm", csr_der=der(fresh))
            body = {"robot": "arm", "nonce": asked["nonce"], "certificate": given["certificate"], "csr": fresh}
            status, renewed = await post(http, "/enrol/renew", **body, proof=b64(sign(key, statement)))
            assert (status, renewed["roots"]) == (200, roots["roots"])
            assert renewed["certificate"] != given["certificate"]
            for proof in ("", "!", b64(b"nothing"), b64(sign(new_key(), statement))):
                status, refused = await post(http, "/enrol/renew", **body, proof=proof)
                assert (status, refused["code"]) == (403, "proof_refused")
        (listed,) = (await people.get(f"{API}/identities")).json()["identities"]
        assert (listed["robot"], listed["state"], listed["alarm"]) == ("arm", "active", "")
        assert [one["how"] for one in listed["certificates"]] == ["renewal", "token"]
        (used,) = (await people.get(f"{API}/enrolment-tokens")).json()["tokens"]
        assert (used["used_by"], used["made_by"], "token" in used) == ("arm", "ada", False)


async def test_refusals_have_their_codes(tmp_path: Path) -> None:
    ring = KeyRing()
    admin = ring.add(role=Role.ADMIN)
    async with running_gateway(tmp_path, authenticator=ring) as ready, client(ready, key=admin) as http:
        open_token, bound = await token(http), await token(http, robot="arm")
        good = ask(new_key())

        async def code(text: str, robot: str = "leg", csr: str = good) -> tuple[int, str]:
            status, answer = await post(http, "/enrol", token=text, robot=robot, csr=csr)
            return status, answer["code"]

        assert await code("mr1.x") == (403, "token_unknown")
        assert await code(bound["token"]) == (403, "token_foreign")
        assert await code(open_token["token"], csr="nothing") == (400, "csr_refused")
        assert await code(open_token["token"], csr=ask(new_key(), uri="spiffe://x/robot/y")) == (400, "csr_refused")
        assert await code(open_token["token"], robot="a/b") == (400, "invalid_request")
        path = f"{API}/enrolment-tokens/{open_token['id']}"
        assert (await http.request("DELETE", path, json={})).status_code == 200
        assert (await http.request("DELETE", path, json={})).json()["code"] == "token_unknown"
        assert await code(open_token["token"]) == (403, "token_unknown")
        assert (await post(http, "/enrolment-tokens", ttl_s=59))[0] == 400
        assert (await post(http, "/robots/leg/revoke", reason=""))[0] == 404


async def test_an_admin_of_some_robots_makes_tokens_for_them(tmp_path: Path) -> None:
    ring = KeyRing()
    admin, some = ring.add(role=Role.ADMIN), ring.add(role=Role.ADMIN, robots=("arm*",))
    async with running_gateway(tmp_path, authenticator=ring) as ready, client(ready, key=some) as http:
        assert (await post(http, "/enrolment-tokens"))[1]["code"] == "invalid_request"
        assert (await post(http, "/enrolment-tokens", robot="leg"))[1]["code"] == "unknown_robot"
        await token(http, robot="arm1")
        async with client(ready, key=admin) as people:
            await token(people, robot="leg")
            both = (await people.get(f"{API}/enrolment-tokens")).json()["tokens"]
        mine = (await http.get(f"{API}/enrolment-tokens")).json()["tokens"]
        assert [one["robot"] for one in mine] == ["arm1"]
        assert len(both) == 2
