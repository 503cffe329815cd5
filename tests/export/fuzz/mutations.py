"""Damage to a file: single bits, lost and doubled parts, and numbers in headers that no file can have."""

import re
import struct

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eED][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_]\w*")
EXTREME = (0, 1, -1, 2, 7, 255, 65_535, 2**31 - 1, -(2**31), 2**32 - 1, 2**40, 2**62, 2**63 - 1, -(2**63))
WORDS = (b"", b"-1", b"0", b"1e999", b"nan", b"-7", b"999999999999", b"99999999", b"1e-400", b"0x1", b"1.5", b"--",
         b"{")  # fmt: skip


def bits(raw, rng):
    """Flip one to eight bits."""
    result = bytearray(raw)
    for at in rng.integers(len(raw), size=rng.integers(1, 9)):
        result[at] ^= 1 << rng.integers(8)
    return bytes(result)


def cut(raw, rng):
    """Keep the beginning."""
    return raw[: rng.integers(len(raw))]


def lost(raw, rng):
    """Leave out some bytes."""
    start = rng.integers(len(raw))
    return raw[:start] + raw[start + rng.integers(1, 100) :]


def doubled(raw, rng):
    """Put some bytes in once more, in another place."""
    start, at = rng.integers(len(raw), size=2)
    return raw[:at] + raw[start : start + rng.integers(1, 300)] + raw[at:]


def integers(raw, rng):
    """Replace a binary integer by one that no header should have; most headers are at the beginning or the end."""
    result, width = bytearray(raw), int(rng.choice((2, 4, 8)))
    for _ in range(rng.integers(1, 3)):
        end = max(1, len(raw) - width)
        at = int(rng.choice((rng.integers(min(512, end)), rng.integers(end), end - rng.integers(min(512, end)))))
        value = EXTREME[rng.integers(len(EXTREME))] & (2 ** (8 * width) - 1)
        result[at : at + width] = struct.pack("<Q", value)[:width]
    return bytes(result)


def numbers(raw, rng):
    """Replace a number that stands as text."""
    places = list(NUMBER.finditer(raw))
    if not places:
        return bits(raw, rng)
    place = places[int(rng.choice((rng.integers(len(places)), rng.integers(min(20, len(places))))))]
    word = WORDS[rng.integers(len(WORDS))]
    if rng.integers(2):  # in fields of fixed width
        word = word.rjust(place.end() - place.start())[: place.end() - place.start()]
    return raw[: place.start()] + word + raw[place.end() :]


def lines(raw, rng):
    """Leave out, double or swap lines of text."""
    parts = raw.splitlines(keepends=True)
    one, other = rng.integers(len(parts), size=2)
    kind = rng.integers(3)
    if kind == 0:
        del parts[one]
    elif kind == 1:
        parts.insert(other, parts[one])
    else:
        parts[one], parts[other] = parts[other], parts[one]
    return b"".join(parts)


def words(raw, rng):
    """Put one word in the place of another one."""
    places = list(WORD.finditer(raw))
    if not places:
        return bits(raw, rng)
    one, other = (places[k] for k in rng.integers(len(places), size=2))
    return raw[: one.start()] + other[0] + raw[one.end() :]


ALL = (bits, cut, lost, doubled, integers, numbers, lines)


TEXT = (numbers, numbers, numbers, words, words, lines, doubled, bits)


def damaged(raw, rng, kinds=ALL):
    """Return the file with one kind of damage, or two."""
    result = kinds[rng.integers(len(kinds))](raw, rng)
    if result and rng.integers(4) == 0:
        result = kinds[rng.integers(len(kinds))](result, rng)
    return result


def damaged_text(raw, rng):
    """Return a text with other numbers, words and lines, most of which can still be read."""
    return damaged(raw, rng, TEXT)
