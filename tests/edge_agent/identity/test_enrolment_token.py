"""A token is taken apart, and its pin accepts one key alone."""

from __future__ import annotations

import pytest

from edge_agent.errors import PinError, TokenFormatError
from edge_agent.identity.enrolment_token import parse_token, pinned_roots
from tests.support.servers.fleet_ca import FleetCa


def test_a_token_is_taken_apart_and_its_secret_not_shown() -> None:
    ca = FleetCa()
    token = parse_token(f"  {ca.token('abc', 'deadbeef' * 4)}\n")
    assert (token.id, token.pin) == ("abc", ca.pin)
    assert "deadbeef" in token.text
    assert "deadbeef" not in repr(token)


@pytest.mark.parametrize(
    "text",
    ["", "hello", "mr2.a." + "0" * 32 + "." + "A" * 43, "mr1.a." + "0" * 31 + "." + "A" * 43, "mr1.a.b.c.d"],
)
def test_what_is_no_token_is_refused_without_repeating_it(text: str) -> None:
    with pytest.raises(TokenFormatError) as error:
        parse_token(text)
    assert not text or text not in str(error.value)


def test_only_roots_with_the_pinned_key_are_taken() -> None:
    ours, other = FleetCa(), FleetCa()
    assert pinned_roots((other.roots + ours.roots).encode(), ours.pin).decode() == ours.roots
    with pytest.raises(PinError, match="another key"):
        pinned_roots(other.roots.encode(), ours.pin)
    with pytest.raises(PinError):
        pinned_roots(b"nothing", ours.pin)
