"""The key of whoever can read the data directory."""

from __future__ import annotations

from pathlib import Path

from gateway.domain.principal import Role
from gateway.identity.authenticator import DenyAllAuthenticator
from gateway.identity.local_key import LOCAL_KEY_FILE, AuthenticatorChain, LocalKey
from tests.support.gateways.memory_authenticator import KeyRing


async def test_it_is_an_administrators_as_long_as_the_process_lives(tmp_path: Path) -> None:
    local, file = LocalKey(tmp_path / "data"), tmp_path / "data" / LOCAL_KEY_FILE
    assert await local.by_key("") is None
    local.write()
    key = file.read_text().strip()
    assert file.stat().st_mode & 0o777 == 0o600
    found = await local.by_key(key)
    assert found is not None
    assert (found.kind, found.id, found.role, found.sees_all) == ("key", "local", Role.ADMIN, True)
    for wrong in ("", key[:-1], key + "x", key.upper(), "mrk_local_", "\udc80"):
        assert await local.by_key(wrong) is None, wrong
    assert await local.by_session(key) is None
    local.remove()
    assert (file.exists(), await local.by_key(key)) == (False, None)
    assert list(file.parent.iterdir()) == []


async def test_every_start_makes_another_one(tmp_path: Path) -> None:
    first, second, file = LocalKey(tmp_path), LocalKey(tmp_path), tmp_path / LOCAL_KEY_FILE
    first.write()
    old = file.read_text().strip()
    second.write()
    new = file.read_text().strip()
    assert await second.by_key(old) is None
    first.remove()
    assert file.read_text().strip() == new, "the file of the next one stays"
    assert await second.by_key(new) is not None


async def test_the_first_authenticator_that_knows_answers() -> None:
    one, two = KeyRing(), KeyRing()
    key, (token, _) = two.add(role=Role.VIEWER, name="two"), two.sign_in(role=Role.ADMIN, name="ann")
    authenticators = AuthenticatorChain(DenyAllAuthenticator(), one, two)
    found, session = await authenticators.by_key(key), await authenticators.by_session(token)
    assert found is not None
    assert session is not None
    assert (found.name, session.name) == ("two", "ann")
    assert (await authenticators.by_key(token), await authenticators.by_session(key)) == (None, None)
