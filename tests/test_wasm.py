"""WebAssembly modules: the C library that was compiled beforehand is enough, so that zig compiles none."""

from __future__ import annotations

from pathlib import Path

import pytest

from tubular_dea.export.compile import CompileError
from tubular_dea.export.wasm import wasm_module
from tubular_dea.export.wasm_runtime import MATHEMATICS, OTHERS, runtime

SOURCE = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
double a_value(double x, char *text)
{
    snprintf(text, 20, "%.6g %ld", x, 3L);
    return pow(x, 1.5) + exp(x) + erf(x) + atan2(x, 2) + tgamma(x);
}
"""


def test_modules_are_linked_without_compiling_a_c_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(tmp_path))
    module = wasm_module({"p_": {"a.c": SOURCE}}, {}, ("malloc", "free", "p_a_value"))
    assert module.startswith(b"\0asm") and b"p_a_value" in module
    assert not list(tmp_path.rglob("lib*.a"))


def test_the_runtime_has_all_that_it_says() -> None:
    text = runtime()
    for name in [*MATHEMATICS.split(), *OTHERS.split()]:
        assert name.encode() in text, name


def test_what_the_compiler_says_is_passed_on() -> None:
    with pytest.raises(CompileError, match="no_such_type"):
        wasm_module({"p_": {"a.c": "no_such_type a;\n"}}, {}, ("p_a",))
