"""Mutations of valid files: noise, pieces of other files, extreme numbers, repaired checksums."""

from __future__ import annotations

import re
import struct
import zlib

MAX_BYTES = 2_000_000
"""Largest mutated file."""

NUMBERS = (
    *("0", "-0", "0.0", "1", "-1", "2", "1e-320", "1e-300", "5e-324", "1e-12", "0.1", "1e6"),
    *("1e10", "1e11", "1e100", "-1e100", "1e153", "1e155", "1e300", "-1e300", "1e308", "-1e308"),
    *("1.7976931348623157e308", "1e309", "-1e309", "inf", "-inf", "Infinity", "nan", "NaN", ".inf"),
    *("2147483647", "2147483648", "4294967295", "9007199254740993", "9223372036854775808", "65536"),
    *("0x10", "1_000", "1:30", "010", "1e", "--1", "+5", "1.5.2", "9" * 400, "1" + "0" * 5000),
    *("\N{ARABIC-INDIC DIGIT THREE}", "\N{FULLWIDTH DIGIT FIVE}", "1,5", "${x}", "6.28", "-6.4"),
)
TEXTS = (
    *("", " ", "\t", "\n", "\r", "\r\n", "\0", "\x1b[2J", "\x7f", "\N{LINE SEPARATOR}", "\x85"),
    *("\N{ZERO WIDTH NO-BREAK SPACE}", "\N{RIGHT-TO-LEFT OVERRIDE}", "e\N{COMBINING ACUTE ACCENT}"),
    *("\N{SNOWMAN}", "\U0001f600", "I\N{COMBINING DOT ABOVE}", "\N{LATIN SMALL LETTER SHARP S}"),
    *("{", "}", "[", "]", "(", ")", "<", ">", "'", '"', "`", "\\", "/", "//", "/*", "(*", "#", "%"),
    *(":", "::", ";", ",", ".", "..", "=", ":=", "|", "&", "*", "&a ", "*a", "!", "!!", "~", "- "),
    *(
        "? ",
        "---\n",
        "...\n",
        "%YAML 9.9\n",
        "<<: *a\n",
        "!!python/object/apply:os.system ['true']",
    ),
    *("!!float ", "!!binary ", "!!set ", "!!timestamp ", "null", "true", "no", "NaN", "None"),
    *("<!DOCTYPE a [<!ENTITY b 'c'>]>", "&b;", "&#0;", "&#x110000;", "<![CDATA[", "]]>", "<?a b?>"),
    *("<!--", "-->", "../../etc/passwd", "/dev/zero", "http://127.0.0.1/", "__import__('os')"),
    *("if", "then", "is", "not", "and", "or", "very", "any", "with", "END_RULEBLOCK", "a" * 3000),
)
BYTES = (
    b"\xff",
    b"\xfe\xff",
    b"\xef\xbb\xbf",
    b"\xc3",
    b"\xed\xa0\x80",
    b"\xf4\x90\x80\x80",
    b"\0",
)
LENGTHS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFF_FFFF, 0x8000_0000, 0xEFFF_FFFF, 0xFFFF_FFFF)

_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_TOKEN = re.compile(rb"[A-Za-z_][A-Za-z0-9_.-]*|\d+|[^\sA-Za-z0-9]")
_SEARCHED = 20_000  # bytes at the start in which numbers and words are replaced
_PNG = b"\x89PNG\r\n\x1a\n"


def mutate(content, others, rng):
    """Return a mutation of ``content``.

    Args:
        content: A valid file.
        others: Other files, of which pieces are inserted.
        rng: Random generator, a ``random.Random``.
    """
    if rng.random() < 0.01:
        return rng.randbytes(rng.choice((0, 1, 4, 30, 300, 3000)))
    strategies = [*_STRATEGIES, _png_chunk] if content.startswith(_PNG) else _STRATEGIES
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        content = rng.choice(strategies)(content, others, rng)[:MAX_BYTES]
    return content


def _span(content, rng):
    """Return start and end of a part of the content, mostly a short one."""
    start = rng.randint(0, len(content))
    length = rng.choice((0, 1, 1, 4, 16, 80, 400, len(content)))
    return start, min(start + rng.randint(0, length), len(content))


def _flip_bits(content, _, rng):
    flipped = bytearray(content)
    for _ in range(rng.randint(1, 8)):
        if flipped:
            flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def _overwrite(content, _, rng):
    start, end = _span(content, rng)
    return content[:start] + rng.randbytes(end - start) + content[end:]


def _truncate(content, _, rng):
    start, end = _span(content, rng)
    return rng.choice((content[:start], content[start:], content[:end] + b"\n"))


def _delete(content, _, rng):
    start, end = _span(content, rng)
    return content[:start] + content[end:]


def _repeat(content, _, rng):
    start, end = _span(content, rng)
    count = rng.choice((2, 3, 10, 100, 1000, 30_000))
    count = min(count, MAX_BYTES // max(end - start, 1))
    return content[:start] + content[start:end] * count + content[end:]


def _insert(content, _, rng):
    new = rng.choice((rng.choice(TEXTS).encode("utf-8", "surrogatepass"), rng.choice(BYTES)))
    at = rng.randint(0, len(content))
    return content[:at] + new + content[at:]


def _splice(content, others, rng):
    other = rng.choice(others)
    start, end = _span(content, rng)
    first, last = _span(other, rng)
    return content[:start] + other[first:last] + content[end:]


def _numbers(content, _, rng):
    return _replaced(content, _NUMBER, _number, rng)


def _tokens(content, others, rng):
    found = [match[0] for match in _TOKEN.finditer(content[:_SEARCHED])]
    other = rng.choice(others)[: _SEARCHED // 10]
    words = (found or [b""], _TOKEN.findall(other) or [b""])
    return _replaced(content, _TOKEN, lambda _, rng: rng.choice(rng.choice(words)), rng)


def _replaced(content, pattern, replacement, rng):
    """Return the content with some of the matches of a pattern replaced."""
    found = list(pattern.finditer(content[:_SEARCHED]))
    chosen = rng.sample(found, min(len(found), rng.choice((1, 1, 2, 5, 1000))))
    parts, at = [], 0
    for match in sorted(chosen, key=lambda m: m.start()):
        parts += [content[at : match.start()], replacement(match, rng)]
        at = match.end()
    return b"".join([*parts, content[at:]])


def _number(match, rng):
    if rng.random() < 0.3:
        return b"%g" % (float(match[0]) * rng.choice((-1, 0, 1e-9, 0.5, 1.001, 2, 100, 1e5, 1e9)))
    return rng.choice(NUMBERS).encode()


def _lines(content, _, rng):
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    a, b = sorted((rng.randrange(len(lines)), rng.randrange(len(lines))))
    change = rng.randrange(4)
    if change == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif change == 1:
        del lines[a : b + 1]
    elif change == 2:
        block = lines[a : b + 1]
        most = 1 + min(200_000 // len(lines), MAX_BYTES // sum(map(len, block)))
        lines[a:a] = block * min(rng.choice((1, 20, 2000)), most)
    else:
        lines[a : b + 1] = rng.sample(lines[a : b + 1], b + 1 - a)
    return b"".join(lines)


def _nest(content, _, rng):
    opening, closing = rng.choice(
        ((b"[", b"]"), (b"{a: ", b"}"), (b'{"a":', b"}"), (b"(", b")"), (b"<a>", b"</a>"),
         (b"- ", b""), (b"not ", b""), (b"(*", b"*)"), (b"'", b"'"), (b"x.", b""))
    )  # fmt: skip
    count = rng.choice((2, 20, 40, 500, 50_000))
    at = rng.randint(0, len(content))
    closed = closing * (count if rng.random() < 0.5 else 0)
    return content[:at] + opening * count + closed + content[at:]


def _length(content, _, rng):
    at = rng.randint(0, max(len(content) - 4, 0))
    size = rng.choice((1, 2, 4, 8))
    number = rng.choice(LENGTHS) & ((1 << (8 * size)) - 1)
    return (
        content[:at] + number.to_bytes(size, rng.choice(("little", "big"))) + content[at + size :]
    )


def _line_ends(content, _, rng):
    return content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b" \n", b"", b"\0")))


def _png_chunk(content, _, rng):
    """Change a chunk of a PNG; its checksum is right, so that its content is read."""
    chunks, at = [], len(_PNG)
    while at + 12 <= len(content):
        (size,) = struct.unpack(">I", content[at : at + 4])
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + size]))
        at += 12 + size
    if not chunks:
        return content
    k = rng.randrange(len(chunks))
    name, data = chunks[k]
    change = rng.randrange(6)
    if change == 0 and name == b"IHDR":
        sides = (0, 1, 2, 9, 7000, 7071, 8000, 30_000, 0x7FFF_FFFF, 0xFFFF_FFFF)
        data = struct.pack(">II", rng.choice(sides), rng.choice(sides)) + data[8:]
    elif change == 1:
        name = rng.choice((b"PLTE", b"tRNS", b"zTXt", b"iTXt", b"iCCP", b"acTL", b"fdAT", b"IDAT"))
    elif change == 2:
        data = zlib.compress(bytes(rng.choice((10, 10_000, 30_000_000))), 9)
        data = rng.choice((b"", b"a\0\0", b"a\0\1\0en\0b\0")) + data
    else:
        data = _mutate_bytes(data, rng)
    chunks[k] = name, data
    if change == 5:
        chunks.insert(k, rng.choice(chunks))
    parts = [
        struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks
    ]
    return _PNG + b"".join(parts)


def _mutate_bytes(content, rng):
    """Return bytes with noise, without pieces of other files."""
    return rng.choice((_flip_bits, _overwrite, _truncate, _delete, _length))(content, (), rng)


_STRATEGIES = (
    *(_flip_bits, _overwrite, _truncate, _delete, _repeat, _insert, _splice, _lines, _nest),
    *(_length, _line_ends, *[_numbers] * 8, *[_tokens] * 3),
)
