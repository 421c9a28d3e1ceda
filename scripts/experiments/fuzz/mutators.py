"""Damage to files: to bytes, lines, numbers, and the trees of JSON and YAML."""

import json
import random
import re
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import yaml

Mutator = Callable[[bytes, random.Random], bytes]

_NUMBERS = (
    "nan", "inf", "-inf", "-0", "0", "-1", "1e308", "1e999", "-1e-320", "9" * 25, "9" * 5000, "0x10",
    "1_000", "", "٣", "1e", "--1", "2147483648", "18446744073709551616", "4e9", "91", "361", "60",
    "99999", "1:2:3:4",
)  # fmt: skip
_WORDS = (
    b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\n\n", b"\r", b"\x0b", b"\x85", b"\xe2\x80\xa8", b'"', b"'", b"#",
    b"%", b"{", b"[" * 2000, b"&a [*a]", b"<<: *a", b"!!python/object/apply:os.system [true]", b",,,,,", b";",
    b"a" * 5000, b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;", b"]]>", b"\xed\xa0\x80", b"\x1b[31m",
)  # fmt: skip
_INTEGERS = 0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1
_VALUES: tuple[Any, ...] = (
    None, True, "", "a", "nan", "\0", "é" * 500, -1, 0, 1, 2**31, 2**63, 10**400, 1e308, -1e-320,
    float("nan"), float("inf"), [], [[]], {}, {"": None}, [0, 0, 0], [1e200] * 3, "2026-13-01",
    "9999-12-31T23:59:59-14:00",
)  # fmt: skip
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_DEEPEST = 5000


def damage_bytes(data: bytes, rng: random.Random) -> bytes:
    """Flip, overwrite, remove, repeat or insert bytes, or truncate."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(found) + 1)
        length = rng.choice((1, 2, 4, 8, rng.randrange(1, len(found) + 2)))
        match rng.randrange(7):
            case 0 if at < len(found):
                found[at] ^= 1 << rng.randrange(8)
            case 1:
                found[at : at + length] = rng.randbytes(min(length, 64))
            case 2:
                del found[at : at + length]
            case 3:
                found[at:at] = found[at : at + length]
            case 4:
                size = rng.choice((1, 2, 4, 8))
                value = rng.choice(_INTEGERS) % 256**size
                found[at : at + size] = value.to_bytes(size, rng.choice(("big", "little")))
            case 5:
                del found[at:]
            case _:
                found[at:at] = rng.choice(_WORDS)
    return bytes(found)


def damage_lines(data: bytes, rng: random.Random) -> bytes:
    """Remove, repeat, swap, join or cut lines."""
    lines = data.split(b"\n")
    for _ in range(rng.choice((1, 1, 2, 5))):
        at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
        match rng.randrange(5):
            case 0:
                del lines[at : at + rng.choice((1, 1, 1, len(lines)))]
                lines = lines or [b""]
            case 1:
                lines[at:at] = [lines[other]] * rng.choice((1, 2, 50))
            case 2:
                lines[at], lines[other] = lines[other], lines[at]
            case 3:
                lines[at] = lines[at] + lines[other]
            case _:
                lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    return b"\n".join(lines)


def damage_numbers(data: bytes, rng: random.Random) -> bytes:
    """Replace numbers in a text by absurd ones, and insert words that mean something to a parser."""
    matches = list(_NUMBER.finditer(data))
    chosen = rng.sample(matches, min(len(matches), rng.choice((1, 1, 2, 8))))
    for match in sorted(chosen, key=lambda one: -one.start()):
        data = data[: match.start()] + rng.choice(_NUMBERS).encode() + data[match.end() :]
    if rng.random() < 0.2:
        at = rng.randrange(len(data) + 1)
        data = data[:at] + rng.choice(_WORDS) + data[at:]
    return data


def damage_tree(data: bytes, rng: random.Random) -> bytes:
    """Change values, names and nesting of a JSON or YAML file, which stays well-formed."""
    is_json = data.lstrip()[:1] == b"{"
    tree = json.loads(data) if is_json else yaml.safe_load(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        tree = _with_damage(tree, rng)
    if is_json:
        return json.dumps(tree).encode()
    return yaml.safe_dump(
        tree, allow_unicode=True, default_flow_style=rng.choice((None, True, False))
    ).encode()


def nest_deeply(data: bytes, rng: random.Random) -> bytes:
    """Put a value, or the whole file, into thousands of brackets or layers of YAML aliases."""
    if rng.random() < 0.5:
        names = [f"a{k}" for k in range(rng.choice((3, 12, 40)))]
        nine = [(name, ", ".join([f"*{before}"] * 9)) for before, name in pairwise(names)]
        rows = [f"{name}: &{name} [{values}]" for name, values in nine]
        head = [f"{names[0]}: &{names[0]} [x, x, x]", *rows]
        matches = list(re.finditer(rb": ([^\n]*)", data))
        if matches:
            match = rng.choice(matches)
            data = data[: match.start(1)] + f"*{names[-1]}".encode() + data[match.end(1) :]
        return "\n".join(head).encode() + b"\n" + data
    depth, (left, right) = rng.randrange(_DEEPEST), rng.choice((b"[]", b"{}", b"<>"))[:2]
    at = rng.randrange(len(data) + 1)
    opened, closed = bytes([left]) * depth, bytes([right]) * rng.choice((depth, 0))
    return data[:at] + opened + data[at : at + 10] + closed + data[at + 10 :]


def grow(data: bytes, rng: random.Random) -> bytes:
    """Repeat a part of the file until it is up to a megabyte long."""
    first = rng.randrange(len(data))
    part = data[first : first + rng.choice((1, 20, 200, len(data)))]
    return data[:first] + part * (rng.choice((10_000, 100_000, 1_000_000)) // len(part)) + data[first:]


TEXT: tuple[Mutator, ...] = (damage_bytes, damage_lines, damage_numbers)
LOG: tuple[Mutator, ...] = (*TEXT * 12, grow)  # grown files take long
TREE: tuple[Mutator, ...] = (*[damage_tree] * 20, *TEXT * 8, *[nest_deeply] * 4, grow)


def _with_damage(tree: Any, rng: random.Random) -> Any:
    """Return a tree with one of its values, names or lists changed."""
    if isinstance(tree, dict) and tree and rng.random() < 0.95:
        key = rng.choice(list(tree))
        others = {name: value for name, value in tree.items() if name != key}
        name = rng.choice((key, "", "x", f"{key}s", f"{key}".upper())) if rng.random() < 0.2 else key
        value = _with_damage(tree[key], rng) if rng.random() < 0.7 else tree[rng.choice(list(tree))]
        return others if rng.random() < 0.1 else {**others, name: value}
    if isinstance(tree, list) and tree and rng.random() < 0.7:
        at = rng.randrange(len(tree))
        inside = rng.choice(([], [tree[at]] * 2, [tree[at]] * 10, [_with_damage(tree[at], rng)]))
        return [*tree[:at], *inside, *tree[at + 1 :]]
    return rng.choice(_VALUES)


def mutate(data: bytes, mutators: Sequence[Mutator], rng: random.Random) -> bytes:
    """Return damaged data, now and then damaged twice."""
    for _ in range(rng.choice((1, 1, 1, 2))):
        try:
            data = rng.choice(mutators)(data, rng) or data
        except Exception:  # damaged already, so no longer of its format
            data = damage_bytes(data, rng)
    return data
