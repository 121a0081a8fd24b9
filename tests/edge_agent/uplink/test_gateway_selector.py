"""Which gateway and which transport come next."""

from __future__ import annotations

import pytest

from edge_agent.config.gateway_address import parse_address
from edge_agent.uplink.gateway_selector import FIRST_AGAIN_S, GatewaySelector
from metaros.clock import ManualClock

ONE, TWO = parse_address("one:1"), parse_address("two:2")


def test_a_gateway_that_worked_is_kept_and_one_that_failed_makes_place() -> None:
    choice = GatewaySelector([ONE, TWO], ManualClock())
    choice.worked("grpc")
    assert choice.gateway is ONE
    choice.failed()
    assert choice.gateway is TWO
    choice.failed()
    assert choice.gateway is ONE


def test_the_transport_that_worked_is_remembered_for_a_while() -> None:
    clock = ManualClock()
    choice = GatewaySelector([ONE, TWO], clock)
    assert choice.transports() == ("grpc", "websocket")
    choice.worked("websocket")
    assert choice.transports() == ("websocket", "grpc")
    clock.advance(FIRST_AGAIN_S / 2)
    choice.worked("websocket")  # at a reconnect: does not make the while longer
    clock.advance(FIRST_AGAIN_S / 2)
    assert choice.transports() == ("grpc", "websocket")
    choice.worked("websocket")
    choice.worked("grpc")
    assert choice.transports() == ("grpc", "websocket")
    choice.failed()
    assert choice.transports() == ("grpc", "websocket"), "of another gateway nothing is known"


def test_a_goodbye_keeps_us_away_from_that_gateway() -> None:
    clock = ManualClock()
    choice = GatewaySelector([ONE, TWO], clock)
    choice.refused("shutting_down", 0.2)
    assert (choice.gateway, choice.hold_s()) == (TWO, 0.0)
    choice.failed()
    assert choice.gateway is ONE
    assert choice.hold_s() == pytest.approx(0.2)
    clock.advance(0.3)
    assert choice.hold_s() == 0.0


def test_a_fenced_agent_stays_away_from_all() -> None:
    choice = GatewaySelector([ONE, TWO], ManualClock())
    choice.refused("fenced", 5.0)
    assert (choice.gateway, choice.hold_s()) == (ONE, 5.0)
    choice.failed()
    assert choice.hold_s() == 5.0


def test_a_forked_outbox_comes_back_at_once() -> None:
    choice = GatewaySelector([ONE, TWO], ManualClock())
    choice.refused("forked", 1.0)
    assert (choice.gateway, choice.hold_s()) == (ONE, 0.0)
