"""Where webhooks and mail may go."""

from __future__ import annotations

import pytest

from gateway.outbound.reach import UnreachableError, address_of, may_go


@pytest.mark.parametrize(
    ("address", "public", "private"),
    [
        ("93.184.216.34", True, True),
        ("2606:2800:220:1::1", True, True),
        ("127.0.0.1", False, True),
        ("::1", False, True),
        ("10.1.2.3", False, True),
        ("192.168.1.1", False, True),
        ("fd00::1", False, True),
        ("::ffff:10.0.0.1", False, True),
        ("64:ff9b::a00:1", False, True),
        ("2002:7f00:1::", False, True),
        ("::127.0.0.1", False, True),
        ("::a9fe:a9fe", False, False),
        ("::ffff:0:169.254.169.254", False, False),
        ("64:ff9b:1::a00:1", False, True),
        ("fec0::1", False, True),
        ("169.254.169.254", False, False),
        ("fe80::1%eth0", False, False),
        ("::ffff:169.254.169.254", False, False),
        ("64:ff9b::a9fe:a9fe", False, False),
        ("0.0.0.0", False, False),
        ("::", False, False),
        ("224.0.0.1", False, False),
        ("100.64.0.1", False, True),
    ],
)
def test_addresses(address: str, public: bool, private: bool) -> None:
    assert (may_go(address, private=False), may_go(address, private=True)) == (public, private)


async def test_a_name_with_a_private_address_is_refused_and_the_hint_says_what_to_do() -> None:
    assert await address_of("localhost", 80, private=True) in ("127.0.0.1", "::1")
    with pytest.raises(UnreachableError, match=r"where nothing is sent: ask somebody$"):
        await address_of("localhost", 80, private=False, hint=": ask somebody")
    with pytest.raises(UnreachableError, match=r"where nothing is sent$"):
        await address_of("169.254.169.254", 80, private=True, hint=": ask somebody")


async def test_a_name_that_is_none() -> None:
    for name in ("no.such.host.invalid", "x" * 300):
        with pytest.raises(UnreachableError, match="cannot be found"):
            await address_of(name, 80, private=True)
