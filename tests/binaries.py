"""What a shared library asks of its system and offers to it, read from its bytes: ELF, PE and Mach-O.

Just enough of each format for that, so that the test needs no tool of any platform.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field


@dataclass
class Library:
    """Processor, libraries needed, symbols exported, and the oldest system (glibc or macOS version)."""

    machine: str
    needs: list[str] = field(default_factory=list)
    exports: list[str] = field(default_factory=list)
    oldest: tuple[int, ...] = ()
    signed: bool = False


def read(data: bytes) -> list[Library]:
    """The libraries in a file: one, or several in a universal Mach-O file."""
    if data[:4] == b"\x7fELF":
        return [_elf(data)]
    if data[:2] == b"MZ":
        return [_pe(data)]
    if data[:4] == b"\xca\xfe\xba\xbe":
        (count,) = struct.unpack_from(">I", data, 4)
        parts = [struct.unpack_from(">5I", data, 8 + 20 * i) for i in range(count)]
        assert all(offset % (1 << align) == 0 for _, _, offset, _, align in parts)
        return [_mach_o(data[offset : offset + size]) for _, _, offset, size, _ in parts]
    return [_mach_o(data)]


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()


def _elf(data: bytes) -> Library:
    """64-bit little-endian ELF: the sections .dynamic, .dynsym and .gnu.version_r with their strings."""
    assert data[4:6] == b"\x02\x01"
    (machine,) = struct.unpack_from("<H", data, 18)
    (table,) = struct.unpack_from("<Q", data, 40)
    size, count = struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, table + i * size) for i in range(count)]
    library = Library({62: "x86_64", 183: "aarch64"}[machine])
    for _, kind, _, _, offset, length, link, info, _, entry in sections:
        strings = sections[link][4] if link < count else 0
        if kind == 6:  # dynamic
            pairs = [struct.unpack_from("<QQ", data, offset + i) for i in range(0, length, entry)]
            library.needs += [_text(data, strings + value) for tag, value in pairs if tag == 1]
        elif kind == 11:  # dynamic symbols
            for i in range(0, length, entry):
                name, bind, _, where = struct.unpack_from("<IBBH", data, offset + i)
                if where and bind >> 4:
                    library.exports.append(_text(data, strings + name))
        elif kind == 0x6FFFFFFE:  # versions needed
            library.oldest = max(_needed_versions(data, offset, info, strings))
    return library


def _needed_versions(data: bytes, offset: int, count: int, strings: int) -> list[tuple[int, ...]]:
    versions = []
    for _ in range(count):
        _, entries, _, first, following = struct.unpack_from("<HHIII", data, offset)
        at = offset + first
        for _ in range(entries):
            _, _, _, name, step = struct.unpack_from("<IHHII", data, at)
            versions.append(tuple(int(n) for n in _text(data, strings + name).removeprefix("GLIBC_").split(".")))
            at += step
        offset += following
    return versions


def _pe(data: bytes) -> Library:
    """PE and PE+: import and export directories."""
    (header,) = struct.unpack_from("<I", data, 0x3C)
    machine, sections, _, _, _, optional_size = struct.unpack_from("<HHIIIH", data, header + 4)
    optional = header + 24
    directories = optional + (112 if struct.unpack_from("<H", data, optional)[0] == 0x20B else 96)
    table = [struct.unpack_from("<8s4I", data, optional + optional_size + 40 * i) for i in range(sections)]

    def place(address: int) -> int:
        return next(address - start + raw for _, size, start, _, raw in table if start <= address < start + size)

    library = Library({0x8664: "x86_64", 0x14C: "x86"}[machine])
    exports, imports = (struct.unpack_from("<I", data, directories + 8 * i)[0] for i in (0, 1))
    count, _, names = struct.unpack_from("<3I", data, place(exports) + 24)
    for i in range(count):
        (name,) = struct.unpack_from("<I", data, place(names) + 4 * i)
        library.exports.append(_text(data, place(name)))
    at = place(imports)
    while name := struct.unpack_from("<I", data, at + 12)[0]:
        library.needs.append(_text(data, place(name)))
        at += 20
    return library


def _mach_o(data: bytes) -> Library:
    """64-bit Mach-O: its load commands and external symbols."""
    magic, machine, _, _, count, _, _, _ = struct.unpack_from("<8I", data)
    assert magic == 0xFEEDFACF
    library = Library({0x01000007: "x86_64", 0x0100000C: "aarch64"}[machine])
    at = 32
    for _ in range(count):
        command, size = struct.unpack_from("<2I", data, at)
        if command == 0xC:  # needs a library
            library.needs.append(_text(data, at + struct.unpack_from("<I", data, at + 8)[0]))
        elif command in (0x24, 0x32):  # oldest system; old and new form
            (version,) = struct.unpack_from("<I", data, at + (8 if command == 0x24 else 12))
            library.oldest = (version >> 16, version >> 8 & 255)
        elif command == 0x1D:
            library.signed = True
        elif command in (0x80000022, 0x80000033):  # what the dynamic linker finds; old and new form
            start, length = struct.unpack_from("<2I", data, at + (40 if command == 0x80000022 else 8))
            library.exports = sorted(name.removeprefix("_") for name in _trie(data[start : start + length], 0, ""))
        at += size
    return library


def _trie(data: bytes, at: int, prefix: str) -> list[str]:
    """The names in a Mach-O export trie from the node at `at` on."""
    size, at = _uleb(data, at)
    names = [prefix] if size else []
    at += size
    children = data[at]
    at += 1
    for _ in range(children):
        edge = _text(data, at)
        node, at = _uleb(data, at + len(edge) + 1)
        names += _trie(data, node, prefix + edge)
    return names


def _uleb(data: bytes, at: int) -> tuple[int, int]:
    """A number of variable length, and the place behind it."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 127) << shift
        shift, at = shift + 7, at + 1
        if byte < 128:
            return value, at
