"""How valid bytes are broken: cut, flipped, lengths inflated, pieces spliced in, doubled or taken out."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from collections.abc import Iterator, Sequence

__all__ = ["mutated", "sweep"]

HUGE = (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0x00FFFFFF, 0x100000000, 2**63 - 1, 2**64 - 1)
TEXTS = (b"\0", b"\xff", b"..", b"/", b"[" * 40, b"{" * 40, b'"', b"9" * 400, b"1e999", b"NaN", b"-1", b"\xed\xa0\x80")
SWEPT = 160  # places of one seed that a sweep visits for each kind of damage


def sweep(seed: bytes, most: int = SWEPT) -> Iterator[bytes]:
    """The seed, then four of each place (of a long one, of some): it ends there, other bits, and 4 or 8 bytes of ff."""
    places = range(len(seed)) if len(seed) <= most else [len(seed) * index // most for index in range(most)]
    yield seed
    for place in places:
        yield seed[:place]
        yield seed[:place] + bytes([seed[place] ^ 0xFF]) + seed[place + 1 :]
        for width in (4, 8):
            yield seed[:place] + b"\xff" * width + seed[place + width :]


def mutated(seeds: Sequence[bytes], rng: random.Random) -> bytes:
    """One seed after one to five kinds of damage."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.randint(1, 5)):
        place = rng.randrange(len(data) + 1)
        match rng.randrange(9):
            case 0:
                del data[place:]
            case 1 if data:
                data[place % len(data)] ^= 1 << rng.randrange(8)
            case 2:
                width, order = rng.choice(((4, "little"), (4, "big"), (8, "little"), (8, "big")))
                number = rng.choice(HUGE) & ((1 << 8 * width) - 1)
                data[place : place + width] = number.to_bytes(width, "little" if order == "little" else "big")
            case 3:
                other = rng.choice(seeds)
                cut = rng.randrange(len(other) + 1)
                data[place:] = other[cut : cut + 4096]
            case 4:
                del data[place : place + rng.randint(1, 16)]
            case 5:
                piece = data[place : place + rng.randint(1, 64)]
                data[place:place] = piece * rng.randint(1, 20)
            case 6:
                data[place:place] = rng.choice(TEXTS)
            case 7:
                data[place:place] = rng.randbytes(rng.randint(1, 8))
            case _ if data:
                data[place % len(data)] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, 0x20, 0x2F, 0x2E, 0x30))
    return bytes(data[: 1 << 18])
