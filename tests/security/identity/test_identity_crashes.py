"""An agent that dies at any step of enrolling or renewing: run again it has its identity, and nobody cries wolf."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from edge_agent.errors import EnrolError, IdentityFileError
from edge_agent.identity.csr import csr_pem, make_csr
from edge_agent.identity.enrol import enrol, renew
from edge_agent.identity.enrolment_token import Token, parse_token
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from edge_agent.identity.gateway_http import GatewayHttpClient
from edge_agent.identity.key import public_der
from tests.gateway.harness import client, running_gateway
from tests.gateway.test_robot_links import ADMIN, RING, alarm

MOST_STEPS = 60
FILES: tuple[tuple[Any, str], ...] = ((os, "open"), (os, "fsync"), (Path, "replace"), (Path, "unlink"))
ANSWERS: tuple[tuple[Any, str], ...] = ((GatewayHttpClient, "post"),)


class KilledError(BaseException):
    """What a kill -9 is to the code: nothing after it happens."""


def full() -> OSError:
    """What a full disk says."""
    return OSError(28, "No space left on device")


@contextmanager
def dying(
    after: int, patch: pytest.MonkeyPatch, death: Callable[[], BaseException], *, answers: bool
) -> Iterator[list[str]]:
    """Die at the step of that number, on this thread: before and after each thing done to a file, and each answer."""
    steps: list[str] = []
    here = threading.get_ident()

    def step(name: str) -> None:
        if threading.get_ident() == here:
            steps.append(name)
            if len(steps) == after:
                raise death()

    def around(real: Callable[..., Any], name: str, *args: Any, **options: Any) -> Any:
        step(f"before {name}")
        done = real(*args, **options)
        step(f"after {name}")
        return done

    with patch.context() as patched:
        for owner, name in FILES + (ANSWERS if answers else ()):
            real = getattr(owner, name)
            wrapped = partial(around, real, name) if owner is os else _method(partial(around, real, name))
            patched.setattr(owner, name, wrapped)
        yield steps


def _method(function: Callable[..., Any]) -> Callable[..., Any]:
    """A partial does not become a method by itself."""
    return lambda self, *args, **options: function(self, *args, **options)


async def order(http: Any) -> Token:
    """A token for the robot alone."""
    answer = await http.post("/api/v1/enrolment-tokens", json={"robot": "arm"})
    return parse_token(answer.json()["token"])


Job = Callable[[], RobotIdentity]


async def cut(
    job: Job, after: int, patch: pytest.MonkeyPatch, death: Callable[[], BaseException]
) -> tuple[bool, list[str]]:
    """Run it until it dies; whether it did not, and the steps that it took."""

    def attempt() -> tuple[bool, list[str]]:
        with dying(after, patch, death, answers=death is KilledError) as steps:
            try:
                job()
            except (KilledError, EnrolError, IdentityFileError):
                return False, steps
            return True, steps

    return await asyncio.to_thread(attempt)


@pytest.mark.integration
@pytest.mark.parametrize("death", [KilledError, full])
async def test_a_death_at_any_step_costs_neither_identity_nor_alarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, death: Callable[[], BaseException]
) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, client(ready, key=ADMIN) as http:
        for after in range(1, MOST_STEPS):
            state = tmp_path / f"robot{after}"
            first = partial(enrol, await order(http), url=ready.url, robot_id="arm", state_dir=state)
            whole, steps = await cut(first, after, monkeypatch, death)
            identity = await asyncio.to_thread(first)  # the same command again
            assert IdentityFiles(state).load() == identity, steps
            renewed, steps = await cut(partial(renew, identity, state), after, monkeypatch, death)
            now = IdentityFiles(state).load()
            assert now is not None, steps
            last = await asyncio.to_thread(renew, now, state)  # whatever holds renews itself again
            assert last.certificate != identity.certificate
            assert await alarm(http, "arm") == "", steps
            if whole and renewed:
                assert after > 10
                return
        raise AssertionError(f"more than {MOST_STEPS} steps")


async def test_the_same_command_again_is_no_attack(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, client(ready, key=ADMIN) as http:
        job = partial(enrol, await order(http), url=ready.url, robot_id="arm")
        first = await asyncio.to_thread(job, state_dir=tmp_path / "robot")
        assert await asyncio.to_thread(job, state_dir=tmp_path / "robot") == first
        second = await asyncio.to_thread(renew, first, tmp_path / "robot")
        assert await asyncio.to_thread(job, state_dir=tmp_path / "robot") == second
        assert await alarm(http, "arm") == ""
        with pytest.raises(EnrolError, match="token_used"):  # somebody else has read the command
            await asyncio.to_thread(job, state_dir=tmp_path / "thief")
        assert "another key" in await alarm(http, "arm")


def test_a_bad_token_does_not_take_a_renewals_key_away(tmp_path: Path) -> None:
    files = IdentityFiles(tmp_path)
    key = public_der(files.pending_key("renew 1", renewal=True))
    files.pending_key("token 1 arm")
    files.forget_pending()
    assert public_der(files.pending_key("renew 1", renewal=True)) == key
    files.forget_pending(renewal=True)
    assert public_der(files.pending_key("renew 1", renewal=True)) != key


async def test_a_gateway_that_dies_before_it_answers_gives_the_same_answer_again(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING) as ready, client(ready, key=ADMIN) as http:
        token = await order(http)
        fleet = (await http.get("/api/v1/enrol/roots")).json()["fleet"]
        key = IdentityFiles(tmp_path / "robot").pending_key(f"token {token.id} arm")
        request = csr_pem(make_csr(key, fleet=fleet, robot_id="arm"))
        body = {"token": token.text, "robot": "arm", "csr": request}
        first = (await http.post("/api/v1/enrol", json=body)).json()  # the robot never hears it
    async with running_gateway(tmp_path, authenticator=RING) as ready:
        job = partial(enrol, token, url=ready.url, robot_id="arm", state_dir=tmp_path / "robot")
        identity = await asyncio.to_thread(job)
        assert identity.certificate == first["certificate"]
        assert public_der(identity.private_key()) == public_der(key)
        async with client(ready, key=ADMIN) as http:
            assert await alarm(http, "arm") == ""
