"""Tokens and identities on both databases: burnt once, retried with the same key, replaced only on purpose."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from gateway.domain.identity import NewCertificate, TokenState
from gateway.errors import IdentityError, TooManyError
from gateway.store.accounts.enrolment import (
    RETRY_S,
    Outcome,
    add_token,
    check_token,
    enrol_robot,
    list_tokens,
    remove_token,
    renew_certificate,
)
from gateway.store.accounts.identities import (
    StoredAuthority,
    add_authority,
    changed_identities,
    list_authorities,
    list_identities,
    revoke_identity,
)
from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.ledger import in_transaction
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until

NOW = 1_700_000_000_000_000_000
HOUR = 3_600_000_000_000
ATTEMPTS, CONNECTIONS = 100, 20


def token(engine: StoreEngine, name: str = "t1", *, robot: str = "", at_ns: int = NOW, most: int = 10) -> None:
    state = TokenState(
        id=name, robot=robot, made_by="ada", made_ns=at_ns, expires_ns=at_ns + HOUR, used_ns=0, used_robot=""
    )
    in_transaction(engine)(lambda db: add_token(db, state, f"hash of {name}", now_ns=at_ns, most=most))


def certificate(robot: str = "arm", key: str = "k1", *, serial: str = "") -> NewCertificate:
    serial = serial or f"serial {robot} {key}"
    return NewCertificate(robot=robot, serial=serial, key_hash=key, not_after_ns=NOW + 24 * HOUR, pem=f"PEM {serial}")


def enrol(engine: StoreEngine, name: str, made: NewCertificate, *, at_ns: int = NOW, secret: str = "") -> Outcome:
    secret = secret or f"hash of {name}"
    return in_transaction(engine)(lambda db: enrol_robot(db, name, secret, made, now_ns=at_ns))


def renew(engine: StoreEngine, parent: str, made: NewCertificate) -> Outcome:
    return in_transaction(engine)(lambda db: renew_certificate(db, parent, made, how="renewal", now_ns=NOW))


def code(call: Callable[[], Outcome]) -> str:
    """Why it is refused; "" when it is not."""
    try:
        refused = call().refused
    except IdentityError as error:
        return error.code
    return refused.code if refused else ""


def alarm_of(engine: StoreEngine, robot: str = "arm") -> str:
    with engine.transaction(write=False):
        return next(item.alarm for item in list_identities(engine, limit=10) if item.robot == robot)


def test_a_token_enrols_one_robot_and_says_so(engine: StoreEngine) -> None:
    token(engine)
    assert enrol(engine, "t1", certificate()).pem == "PEM serial arm k1"
    with engine.transaction(write=False):
        (stored,), (identity,) = list_tokens(engine, limit=5), list_identities(engine, limit=5)
    assert (stored.used_robot, stored.used_ns, stored.made_by) == ("arm", NOW, "ada")
    assert (identity.robot, identity.revoked_ns, identity.alarm) == ("arm", 0, "")
    assert [(one.serial, one.how) for one in identity.certificates] == [("serial arm k1", "token")]


def test_a_lost_answer_may_be_asked_for_again_with_the_same_key_for_ten_minutes(engine: StoreEngine) -> None:
    token(engine)
    first = enrol(engine, "t1", certificate())
    late = NOW + round(RETRY_S * 1e9)
    again = enrol(engine, "t1", certificate(serial="another"), at_ns=late)
    assert (again.pem, again.fresh) == (first.pem, False)
    assert code(lambda: enrol(engine, "t1", certificate(), at_ns=late + 1)) == "token_used"
    assert alarm_of(engine) == ""
    assert code(lambda: enrol(engine, "t1", certificate(key="k2"))) == "token_used"
    assert "another key" in alarm_of(engine)


def test_a_token_that_is_not_good_is_refused_by_name(engine: StoreEngine) -> None:
    token(engine, "bound", robot="arm")
    token(engine, "open")
    assert code(lambda: enrol(engine, "nobody", certificate())) == "token_unknown"
    assert code(lambda: enrol(engine, "open", certificate(), secret="guessed")) == "token_unknown"
    assert code(lambda: enrol(engine, "bound", certificate("leg"))) == "token_foreign"
    assert code(lambda: enrol(engine, "open", certificate(), at_ns=NOW + HOUR)) == "token_expired"
    assert code(lambda: enrol(engine, "open", certificate(), at_ns=NOW + HOUR - 1)) == ""
    assert code(lambda: enrol(engine, "bound", certificate(key="k2"))) == ""


def test_of_a_hundred_at_once_one_wins(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(CONNECTIONS)]
    token(engines[0])
    free, start = list(engines), threading.Barrier(CONNECTIONS)
    mine = threading.local()

    def attempt(number: int) -> str:
        if not hasattr(mine, "engine"):
            mine.engine = free.pop()
            start.wait(60)
        made = certificate(f"robot{number}", f"k{number}")
        return code(lambda: enrol(mine.engine, "t1", made)) or f"robot{number}"

    with ThreadPoolExecutor(CONNECTIONS) as pool:
        results = list(pool.map(attempt, range(ATTEMPTS)))
    (winner,) = [result for result in results if result.startswith("robot")]
    assert results.count("token_used") == ATTEMPTS - 1
    with engines[0].transaction(write=False):
        assert [item.robot for item in list_identities(engines[0], limit=ATTEMPTS)] == [winner]


def test_a_hundred_retries_at_once_get_one_certificate(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(CONNECTIONS)]
    token(engines[0])
    free, mine = list(engines), threading.local()

    def attempt(number: int) -> str:
        if not hasattr(mine, "engine"):
            mine.engine = free.pop()
        return enrol(mine.engine, "t1", certificate(serial=f"serial {number}")).pem

    with ThreadPoolExecutor(CONNECTIONS) as pool:
        assert len(set(pool.map(attempt, range(ATTEMPTS)))) == 1


def test_two_tokens_never_make_one_robot_twice(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(10)]
    for number in range(10):
        token(engines[0], f"t{number}")
    with ThreadPoolExecutor(10) as pool:
        tries = [pool.submit(code, lambda n=n: enrol(engines[n], f"t{n}", certificate(key=f"k{n}"))) for n in range(10)]
        assert sorted(one.result() for one in tries) == ["", *["token_foreign"] * 9]
    with engines[0].transaction(write=False):
        assert sum(1 for one in list_tokens(engines[0], limit=20) if one.used_ns) == 1  # the others may still be used


def test_only_a_token_for_this_robot_replaces_its_identity(engine: StoreEngine) -> None:
    for name, robot in (("t1", ""), ("t2", ""), ("t3", "arm")):
        token(engine, name, robot=robot)
    enrol(engine, "t1", certificate())
    assert code(lambda: enrol(engine, "t2", certificate(key="k2"))) == "token_foreign"
    assert enrol(engine, "t3", certificate(key="k3")).fresh
    assert code(lambda: renew(engine, "serial arm k1", certificate(key="k4"))) == "certificate_revoked"
    assert code(lambda: renew(engine, "serial arm k3", certificate(key="k4"))) == ""


def test_a_renewal_is_done_once_and_a_second_key_is_a_clone(engine: StoreEngine) -> None:
    token(engine)
    enrol(engine, "t1", certificate())
    first = renew(engine, "serial arm k1", certificate(key="k2"))
    again = renew(engine, "serial arm k1", certificate(key="k2", serial="another"))
    assert (again.pem, again.fresh) == (first.pem, False)
    assert alarm_of(engine) == ""
    assert code(lambda: renew(engine, "serial arm k1", certificate(key="k3"))) == "clone_detected"
    assert "renewed twice" in alarm_of(engine)
    assert code(lambda: renew(engine, "serial arm k2", certificate(key="k5"))) == ""
    assert code(lambda: renew(engine, "x", certificate("leg"))) == "certificate_foreign"


def test_revocation_is_seen_by_everybody_who_looks(connect: Callable[[], StoreEngine]) -> None:
    engine, other = connect(), connect()
    token(engine)
    token(engine, "t2", robot="arm")
    enrol(engine, "t1", certificate())
    with other.transaction(write=False):
        seen, (state,) = changed_identities(other, 0)
    assert (state.robot, state.revoked_ns, state.revoked_serials) == ("arm", 0, frozenset())
    run = in_transaction(engine)
    assert run(lambda db: revoke_identity(db, "arm", "stolen", now_ns=NOW + 1))
    assert not run(lambda db: revoke_identity(db, "arm", "again", now_ns=NOW + 2))
    assert not run(lambda db: revoke_identity(db, "leg", "", now_ns=NOW))
    with other.transaction(write=False):
        seen, (state,) = changed_identities(other, seen)
        assert changed_identities(other, seen)[1] == []
    assert (state.revoked_ns, state.reason, state.revoked_serials) == (NOW + 1, "stolen", {"serial arm k1"})
    assert code(lambda: renew(engine, "serial arm k1", certificate(key="k2"))) == "certificate_revoked"
    assert code(lambda: enrol(engine, "t1", certificate())) == "token_used"  # its retry is no way back
    assert enrol(engine, "t2", certificate(key="k9")).fresh
    with other.transaction(write=False):
        _, (state,) = changed_identities(other, seen)
    assert (state.revoked_ns, state.revoked_serials) == (0, {"serial arm k1"})


def test_tokens_are_bounded_taken_back_and_forgotten(engine: StoreEngine) -> None:
    token(engine, "t1", most=1)
    with pytest.raises(TooManyError):
        token(engine, "t2", most=1)
    assert in_transaction(engine)(lambda db: remove_token(db, "t1"))
    assert not in_transaction(engine)(lambda db: remove_token(db, "t1"))
    token(engine, "t3", most=1)
    token(engine, "t4", most=1, at_ns=NOW + 100 * 24 * HOUR)
    with engine.transaction(write=False):
        assert [one.id for one in list_tokens(engine, limit=9)] == ["t4"]


def test_of_two_gateways_that_start_one_makes_the_authority(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(8)]

    def make(number: int) -> bool:
        one = StoredAuthority(
            id=f"a{number}", root="R", certificate="C", sealed_key=b"\x00s", made_ns=number, not_after_ns=NOW
        )
        return in_transaction(engines[number])(lambda db: add_authority(db, one, newest=""))

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(make, range(8))) == 1
    with engines[0].transaction(write=False):
        (stored,) = list_authorities(engines[0])
    assert (stored.root, stored.sealed_key) == ("R", b"\x00s")


def test_a_renewal_under_way_does_not_survive_a_new_enrolment(postgres: PostgresServer, tmp_path: Path) -> None:
    url = postgres.schema()
    with closing(open_engine(url, tmp_path)[0]) as owner, closing(open_engine(url, tmp_path)[0]) as thief:
        token(owner)
        token(owner, "t2", robot="arm")
        enrol(owner, "t1", certificate())
        with ThreadPoolExecutor(1) as pool:
            with thief.transaction(write=True):
                renew_certificate(thief, "serial arm k1", certificate(key="k2"), how="renewal", now_ns=NOW)
                again = pool.submit(enrol, owner, "t2", certificate(key="k3"))
                waiting = "SELECT count(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock'"
                wait_until(lambda: postgres.ask(waiting)[0][0] or again.done())
            assert again.result(60).fresh
        with owner.transaction(write=False):
            (state,) = changed_identities(owner, 0)[1]
        assert state.revoked_serials == {"serial arm k1", "serial arm k2"}
        assert code(lambda: renew(owner, "serial arm k2", certificate(key="k4"))) == "certificate_revoked"


def test_a_token_of_the_future_waits_for_the_clock(engine: StoreEngine) -> None:
    token(engine, at_ns=NOW + 10 * HOUR)  # made before somebody set the gateway's clock back
    assert code(lambda: enrol(engine, "t1", certificate())) == "token_expired"
    assert code(lambda: enrol(engine, "t1", certificate(), at_ns=NOW + 10 * HOUR)) == ""


def test_a_guess_is_reported_apart_without_writing(engine: StoreEngine) -> None:
    token(engine)
    with engine.transaction(write=False):
        check_token(engine, "t1", "hash of t1")
        for name, secret in (("t1", "hash of t2"), ("t1", ""), ("t9", "hash of t1"), ("t9", "")):
            with pytest.raises(IdentityError, match="no such enrolment token"):
                check_token(engine, name, secret)
