"""Whose turn it is, among the gateways of one store."""

from __future__ import annotations

from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import give_duties, take_duty

S = 10**9


def take(engine: StoreEngine, holder: str, *, at_s: int, duty: str = "clock") -> bool:
    with engine.transaction(write=True):
        return take_duty(engine, duty, holder, now_ns=at_s * S, for_ns=60 * S)


def test_a_duty_is_one_gateways_until_its_time_is_over(engine: StoreEngine) -> None:
    assert take(engine, "a", at_s=0)
    assert not take(engine, "b", at_s=59)
    assert take(engine, "b", at_s=60)
    assert not take(engine, "a", at_s=61)


def test_what_a_gateway_gives_back_at_its_end_is_anybodys_at_once_and_nothing_else(engine: StoreEngine) -> None:
    assert take(engine, "a", at_s=0)
    assert take(engine, "c", at_s=0, duty="sweep")
    with engine.transaction(write=True):
        give_duties(engine, "a")
    assert take(engine, "b", at_s=1)
    assert not take(engine, "b", at_s=1, duty="sweep")
