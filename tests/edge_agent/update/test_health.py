"""When a new agent is kept, and when it is taken back."""

from __future__ import annotations

from edge_agent.update.health import Health


def health() -> Health:
    return Health(100.0, window_s=10.0, within_s=30.0)


def test_linked_confirmed_and_stayed() -> None:
    found = health()
    found.linked(105.0)
    found.confirmed()
    assert found.verdict(114.9) == "waiting"
    assert abs(found.wait_s(114.9) - 0.1) < 1e-6
    assert found.verdict(115.0) == "healthy"


def test_never_linked() -> None:
    found = health()
    assert found.verdict(129.9) == "waiting"
    assert found.verdict(130.0) == "unhealthy"
    assert found.reason == "it never linked to a gateway"


def test_linked_but_not_confirmed() -> None:
    found = health()
    found.confirmed()  # before there is a link it means nothing
    found.linked(101.0)
    assert found.verdict(129.0) == "waiting"
    assert found.verdict(130.0) == "unhealthy"
    assert found.reason == "no gateway confirmed it"


def test_a_link_that_breaks_begins_the_window_anew() -> None:
    found = health()
    for at_s in (101.0, 110.0, 119.0):
        found.linked(at_s)
        found.confirmed()
        assert found.verdict(at_s + 8.0) == "waiting"
        found.lost()
    assert found.verdict(129.0) == "waiting"
    assert found.verdict(130.0) == "unhealthy"
    assert "did not last" in found.reason


def test_the_last_moment_is_early_enough() -> None:
    found = health()
    found.linked(120.0)
    found.confirmed()
    assert found.verdict(130.0) == "healthy"
    late = health()
    late.linked(120.1)
    late.confirmed()
    assert late.verdict(130.0) == "unhealthy"
    assert late.reason == "it linked too late"
