"""Patterns of hosts and ports, and which addresses names may lead to."""

from __future__ import annotations

import pytest

from metaros.automation.functions.egress.rules import EgressRules, may_reach, parse_bound, parse_egress
from metaros.errors import FieldError
from tests.support.tables import cases

PUBLIC, PRIVATE, LINK = "93.184.216.34", "10.1.2.3", "169.254.169.254"


def allowed(text: str, host: str, port: int, address: str) -> bool:
    check = parse_egress(text).check(host, port)
    return check is not None and check(address)


@cases(
    ("text", "host", "port"),
    [
        ("hooks.slack.com", "hooks.slack.com", 443),
        ("hooks.slack.com", "hooks.slack.com", 80),
        ("Hooks.Slack.com.", "hooks.slack.com", 443),
        ("*.amazonaws.com:443", "s3.eu-central-1.amazonaws.com", 443),
        (" a.example , b.example:8443 ", "b.example", 8443),
        ("*", "anything.example", 443),
        ("*", PUBLIC, 443),
        ("xn--bcher-kva.example", "xn--bcher-kva.example", 443),
    ],
)
def test_what_a_pattern_means(text: str, host: str, port: int) -> None:
    assert allowed(text, host, port, PUBLIC)
    assert not allowed(text, host, port, PRIVATE)
    assert not allowed(text, host, port, LINK)


@cases(
    ("text", "host", "port"),
    [
        ("hooks.slack.com", "hooks.slack.com", 8080),
        ("hooks.slack.com", "slack.com", 443),
        ("hooks.slack.com", "hooks.slack.com.evil.example", 443),
        ("*.amazonaws.com", "amazonaws.com", 443),
        ("*.amazonaws.com", "evilamazonaws.com", 443),
        ("a.example:443", "a.example", 80),
        ("127.0.0.1:8123", "localhost", 8123),
        ("127.0.0.1:8123", "127.0.0.1", 8124),
        ("", "a.example", 443),
    ],
)
def test_what_a_pattern_does_not_mean(text: str, host: str, port: int) -> None:
    assert parse_egress(text).check(host, port) is None


def test_an_address_is_allowed_as_it_is_written() -> None:
    assert allowed("127.0.0.1:8123", "127.0.0.1", 8123, "127.0.0.1")
    assert allowed(f"{LINK}:80", LINK, 80, LINK)
    assert allowed("[::1]:8123", "::1", 8123, "::1")
    assert allowed("[0:0:0:0:0:0:0:1]:8123", "::1", 8123, "::1")


def test_private_is_asked_for() -> None:
    for address in (PRIVATE, "127.0.0.1", "192.168.1.9", "::1", "fd12::1", "100.64.1.1", PUBLIC):
        assert allowed("private:db.lan:5432", "db.lan", 5432, address)
    for address in (LINK, "fe80::1", "fd00:ec2::254", "224.0.0.1", "::", "0.0.0.0", "100.100.100.200"):
        assert not allowed("private:db.lan:5432", "db.lan", 5432, address)


@cases(
    "address",
    [
        *(
            "127.0.0.1",
            "10.0.0.1",
            "172.16.0.1",
            "192.168.0.1",
            "100.64.0.1",
            "169.254.1.1",
            "0.0.0.0",
            "255.255.255.255",
        ),
        *("224.0.0.1", "240.0.0.1", "198.18.0.1", "::1", "::", "fe80::1", "fe80::1%eth0", "fc00::1", "ff02::1"),
        *("::ffff:127.0.0.1", "::127.0.0.1", "64:ff9b::7f00:1", "64:ff9b::a9fe:a9fe", "2002:7f00:1::", "2001:db8::1"),
        *("168.63.129.16", "::ffff:168.63.129.16", "192.0.0.192", "4000::1"),
    ],
)
def test_what_is_not_public(address: str) -> None:
    assert not may_reach(address, private=False)


@cases("address", [PUBLIC, "1.1.1.1", "2606:4700:4700::1111", "64:ff9b::101:101", "::ffff:1.1.1.1"])
def test_what_is_public(address: str) -> None:
    assert may_reach(address, private=False)


@cases(
    "text",
    [
        *(
            "https://a.example",
            "a.example/",
            "a b",
            "a.example:",
            "a.example:0",
            "a.example:65536",
            "a.example:x",
            ":443",
        ),
        *(
            "*a.example",
            "a.*.example",
            "**",
            "*.",
            "-a.example",
            "a..example",
            "bücher.example",
            "::1",
            "[127.0.0.1]:80",
        ),
        *("1.2.3", "1.2.3.4.5", "10.0.0.0/8", "127.1", "user@a.example", "private:", "private:private:a", "a" * 300),
        *("a.example:٤٤٣", "a.example:443:443", "[::1", "a.example:+80"),
    ],
)
def test_what_is_no_pattern_is_named(text: str) -> None:
    with pytest.raises(FieldError, match=r"^METAROS_EGRESS: ") as caught:
        parse_egress(f"ok.example, {text}")
    assert repr(text[:200]) in str(caught.value)


def test_there_are_not_too_many() -> None:
    with pytest.raises(FieldError, match="101 patterns, at most 100"):
        parse_egress(",".join(["a.example"] * 101))


def test_a_bound() -> None:
    assert parse_bound("any", field="--x") is None
    assert parse_bound("none", field="--x") == EgressRules()
    bound = parse_bound("*.example", field="--x")
    assert bound is not None
    assert bound.check("a.example", 443) is not None
    with pytest.raises(FieldError, match=r"^--x: 'a b'"):
        parse_bound("a b", field="--x")
