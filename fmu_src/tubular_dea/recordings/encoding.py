"""From bytes to lines: byte order marks, UTF-8, UTF-16 with and without mark, and what Western machines write."""

from __future__ import annotations

import codecs
from pathlib import Path

from ..errors import ReadError

MARKS = (
    (codecs.BOM_UTF8, "utf-8", "UTF-8 with byte order mark"),
    (codecs.BOM_UTF32_LE, "utf-32-le", "UTF-32"),
    (codecs.BOM_UTF32_BE, "utf-32-be", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16-le", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16-be", "UTF-16"),
)
CONTROLS = frozenset(range(32)) - {7, 8, 9, 10, 11, 12, 13, 26, 27, 28, 29, 30, 31}  # what no text file holds


def decoded(path: Path, raw: bytes) -> tuple[str, str]:
    """The text of a file, and the name of its encoding; `ReadError` for what is no text."""
    for mark, codec, name in MARKS:
        if raw.startswith(mark):
            return _strictly(path, raw[len(mark) :], codec, name), name
    sample = raw[:4096]
    if b"\0" in sample:
        codec = _utf16(sample)
        if codec:
            return _strictly(path, raw, codec, "UTF-16"), "UTF-16"
    if not CONTROLS.isdisjoint(raw[:65536]) or b"\0" in raw:
        at = next(i for i, byte in enumerate(raw) if byte in CONTROLS)
        raise ReadError(
            f"{path}, line {raw[:at].count(10) + 1}: cannot be read as a text file: expected characters but found the "
            f"byte {raw[at]}; export it as CSV, or give it the ending of its format"
        )
    try:
        return raw.decode("utf-8"), "UTF-8" if not raw.isascii() else "ASCII"
    except UnicodeDecodeError:
        pass
    try:
        return raw.decode("cp1252"), "Windows-1252"
    except UnicodeDecodeError:
        return raw.decode("latin-1"), "Latin-1"


def lines_of(text: str) -> list[str]:
    """Lines as editors count them, whatever ends them; the last is empty where the file ends with a line's end."""
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.split("\n")


def _strictly(path: Path, raw: bytes, codec: str, name: str) -> str:
    try:
        text = raw.decode(codec)
    except UnicodeDecodeError as problem:
        raise ReadError(
            f"{path}: cannot be read as a text file: expected {name}, as its first bytes say, but byte "
            f"{problem.start} is none; save it as CSV in UTF-8"
        ) from None
    if "\0" in text:
        raise ReadError(f"{path}: cannot be read as a text file: expected characters but found NUL; save it as CSV")
    return text


def _utf16(sample: bytes) -> str:
    """The codec of UTF-16 without a mark, whose every second byte is 0 in the numbers of a table; "" for others."""
    even, odd = sample[0::2].count(0), sample[1::2].count(0)
    half = len(sample) // 2
    if odd > 0.7 * half and even < 0.05 * half:
        return "utf-16-le"
    return "utf-16-be" if even > 0.7 * half and odd < 0.05 * half else ""
