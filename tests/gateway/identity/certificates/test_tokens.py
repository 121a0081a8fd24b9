"""Tokens: what is stored is not what the robot is given, and only the very text is a token."""

from __future__ import annotations

import pytest

from gateway.errors import IdentityError
from gateway.identity.certificates.tokens import make_token, parse_token

PIN = "A" * 43


def test_a_token_is_read_again_and_its_hash_says_nothing() -> None:
    token, other = make_token(PIN), make_token(PIN)
    assert parse_token(f" {token.text}\n") == token
    assert token.secret_hash == parse_token(token.text).secret_hash != other.secret_hash
    assert token.secret not in token.secret_hash + repr(token)
    assert len({make_token(PIN).text for _ in range(100)}) == 100


def test_other_text_is_no_token() -> None:
    text = make_token(PIN).text
    for wrong in ("", "mr1", text[:-1], text + "A", text.replace("mr1", "mr2"), text.upper(), text.replace(".", "/")):
        with pytest.raises(IdentityError) as refused:
            parse_token(wrong)
        assert refused.value.code == "token_unknown"
