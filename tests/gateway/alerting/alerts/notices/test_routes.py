"""The file of --notify: what it may say, and what is wrong with it."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import pytest

from gateway.alerting.alerts.notices.route import Mailbox, Route
from gateway.alerting.alerts.notices.routes import load_routes
from gateway.outbound.webhook import Webhook
from metaros.errors import ConfigError
from tests.support.servers.certificates import make_certificate
from tests.support.tables import refusal

HOOK = '[[webhook]]\nname = "ops"\nurl = "https://hooks.example.org/x"\n'
MAIL = '[[smtp]]\nname = "mail"\nhost = "mx.example.org"\nfrom = "a@example.org"\nto = ["b@example.org"]\n'


def load(folder: Path, text: str) -> tuple[Route, ...]:
    """What a file of that text says."""
    path = folder / "notify.toml"
    path.write_text(text)
    return load_routes(path)


def secret(folder: Path, name: str, text: str, mode: int = 0o600) -> None:
    """A file that only we can read."""
    path = folder / name
    path.write_text(text)
    path.chmod(mode)


def test_the_least_that_a_file_says(tmp_path: Path) -> None:
    hook, mail = load(tmp_path, HOOK + MAIL)
    assert (hook.name, hook.kind, hook.severity, hook.wait_s, hook.repeat_s) == ("ops", "webhook", "warning", 10, 14400)
    assert hook.to == Webhook(url="https://hooks.example.org/x")
    assert mail.to == Mailbox(
        host="mx.example.org", port=587, tls="starttls", sender="a@example.org", to=("b@example.org",)
    )
    assert load(tmp_path, "") == ()


def test_all_that_a_file_may_say(tmp_path: Path) -> None:
    secret(tmp_path, "hook.secret", "swordfish\n")
    secret(tmp_path, "hook.token", "abc\n")
    secret(tmp_path, "mail.password", "pass\n")
    make_certificate(tmp_path)
    top = 'wait_s = 2\nrepeat_s = 3600\nlink = "https://fleet.example.org"\n'
    hook = HOOK + 'robots = ["a*"]\ncauses = ["heat"]\nseverity = "error"\nwait_s = 0\nca_file = "localhost.pem"\n'
    hook += 'secret_file = "hook.secret"\ntoken_file = "hook.token"\nprivate = true\n'
    mail = MAIL + 'port = 2525\ntls = "tls"\nuser = "me"\npassword_file = "mail.password"\n'
    one, two = load(tmp_path, top + hook + mail)
    assert (one.wait_s, two.wait_s, one.repeat_s, one.link) == (0, 2, 3600, "https://fleet.example.org")
    assert (one.robots, one.causes, one.severity) == (("a*",), ("heat",), "error")
    assert isinstance(one.to, Webhook)
    assert (one.to.secret, one.to.token, one.to.private) == (b"swordfish", "abc", True)
    assert one.to.context is not None
    assert isinstance(two.to, Mailbox)
    assert (two.to.user, two.to.password, two.to.port, two.to.tls) == ("me", "pass", 2525, "tls")
    assert "swordfish" not in repr(one)
    assert "abc" not in repr(one)
    assert "pass" not in repr(two)


def test_a_secret_of_standard_webhooks_is_base64(tmp_path: Path) -> None:
    secret(tmp_path, "s", "whsec_" + base64.b64encode(b"key").decode())
    (route,) = load(tmp_path, HOOK + 'secret_file = "s"')
    assert isinstance(route.to, Webhook)
    assert route.to.secret == b"key"
    secret(tmp_path, "s", "whsec_*")
    with pytest.raises(ConfigError, match="no base64"):
        load(tmp_path, HOOK + 'secret_file = "s"')


def test_what_is_shown_of_a_target_is_no_secret(tmp_path: Path) -> None:
    for path in ("/x", "/services/T00/B00/swordfish", "/?key=swordfish"):
        (route,) = load(tmp_path, HOOK.replace("/x", path))
        assert route.to.target == "https://hooks.example.org/…"
        assert "swordfish" not in repr(route)
    (route,) = load(tmp_path, HOOK.replace("/x", "/"))
    assert route.to.target == "https://hooks.example.org/"


WRONG = (
    ("= 1", "not TOML"),
    ("surprise = 1", "surprise is no key"),
    ("webhook = 1", "written \\[\\[webhook\\]\\]"),
    ("wait_s = -1", "wait_s of the top is 0 to 30 days"),
    ("wait_s = true", "wait_s of the top"),
    ("wait_s = nan", "wait_s of the top"),
    ('[[webhook]]\nname = "ops"', "webhook ops lacks url"),
    ('[[webhook]]\nurl = "https://x"', "webhook 1 lacks name"),
    (HOOK + HOOK, "two routes are called ops"),
    (HOOK + "secret = 1", "secret is no key of webhook ops"),
    (HOOK + 'severity = "fatal"', "severity of webhook ops is one of info, warning, error"),
    (HOOK + 'private = "yes"', "private of webhook ops is true or false"),
    (HOOK + "robots = [1]", "robots of webhook ops is a list of patterns"),
    (HOOK + "repeat_s = 1", "repeat_s of webhook ops is 60 s to 30 days"),
    (HOOK + 'link = "javascript:1"', "link of webhook ops"),
    (HOOK + 'secret_file = "none"', "none: No such file"),
    (HOOK + 'ca_file = "notify.toml"', "no PEM"),
    (HOOK.replace("https", "http"), "plain only within a private network"),
    (HOOK.replace("https:", "file:"), "no http\\(s\\) URL"),
    (HOOK.replace("hooks.", "me:pw@hooks."), "has a user in it"),
    (HOOK.replace("org/", "org:99999/"), "no http\\(s\\) URL"),
    (HOOK.replace('"ops"', '"Ops!"'), "name of webhook Ops! is 1 to 63"),
    (MAIL + 'user = "me"', "go together"),
    (MAIL + 'tls = "off"', "only within a private network"),
    (MAIL + 'tls = "ssl"', "tls of smtp mail is one of starttls, tls, off"),
    (MAIL + "port = 0", "port of smtp mail is 1 to 65535"),
    (MAIL.replace('["b@example.org"]', "[]"), "to of smtp mail is 1 to 32 addresses"),
    (MAIL.replace('["b@example.org"]', '["b@x>\\nRCPT TO:<c@y"]'), "to of smtp mail"),
    (MAIL.replace("a@example.org", "nobody"), "from of smtp mail"),
    (HOOK * 33, "33 routes, at most 32"),
)


def test_what_is_wrong_is_named(tmp_path: Path) -> None:
    said = {text: refusal(ConfigError, load, tmp_path, text) for text, _ in WRONG}
    assert [(text, said[text]) for text, message in WRONG if not re.search(message, said[text])] == []


def test_a_secret_that_others_can_read_is_none(tmp_path: Path) -> None:
    secret(tmp_path, "s", "swordfish", 0o644)
    with pytest.raises(ConfigError, match="others can read"):
        load(tmp_path, HOOK + 'secret_file = "s"')
    secret(tmp_path, "s", "\n")
    with pytest.raises(ConfigError, match="is empty"):
        load(tmp_path, HOOK + 'secret_file = "s"')
    secret(tmp_path, "s", "a\nb")
    with pytest.raises(ConfigError, match="what no header may"):
        load(tmp_path, HOOK + 'token_file = "s"')


def test_a_file_that_is_not_there_or_too_large(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load_routes(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="is over"):
        load(tmp_path, "#" * 300_000)
