"""Hostile files for every reader: one clear line, exit code 2, nothing written and nothing carried out.

Each text is a way in which files go wrong or are made to go wrong; each reader is a command with one file of its own
replaced by it. Archives are read in two places: FMUs by sweeps (sweep/external.py) and by the master (cosim/slaves.py).
SSPs are written (`build`) and read by nothing here. An FMU that is well-formed brings native code, which is carried out
with all rights of the user: nothing here can or does protect from that.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tubular_dea.cli import main

BENCH = "time [s],pressure [Pa],voltage [V],radius [m]"
PLAN = 'outputs = ["final lambda_2"]\n[inputs]\npressure = "1 kPa"\nvoltage = "0 V"\n[vary]\n'
ROWS = "".join(f"\n{0.004 * i:.3f},1,2,0.015,60" for i in range(400))
HEADER = "time [s],pressure [Pa],voltage [V],radius [m],C_1 [kPa]"
COLUMNS = 100_000
DEEP = 100_000

TEXTS: dict[str, bytes] = {
    "nothing": b"",
    "NUL bytes": b"\0" * 4096,
    "NUL in a table": (HEADER + ROWS).replace("1,2", "1\0,2").encode(),
    "random bytes": bytes(range(256)) * 64,
    "UTF-16": (HEADER + ROWS).encode("utf-16"),
    "Latin-1": "Druck [µPa],Größe\n1,2\n".encode("latin-1"),
    "a byte order mark alone": b"\xef\xbb\xbf",
    "many columns": (",".join(f"c{i} [Pa]" for i in range(COLUMNS)) + "\n").encode() * 2,
    "one long cell": b"time [s]," + b"x" * 1_000_000 + b"\n1,2\n1,2\n",
    "formulas": f"{HEADER}\n=cmd|'/C calc'!A0,1,2,3,4\n@SUM(1),1,2,3,4\n+1+cmd,1,2,3,4\n".encode() * 200,
    "an expression": (HEADER + ROWS.replace(",1,", ",__import__('os').system('touch hacked'),")).encode(),
    "decimal commas": (HEADER + ROWS.replace(",", ";").replace(".", ",")).encode(),
    "semicolons": (HEADER + ROWS).replace(",", ";").encode(),
    "huge numbers": (HEADER + ROWS.replace(",1,", ",1e999,").replace(",60", ",1e999")).encode(),
    "many digits": (HEADER + ROWS.replace(",1,", f",{'9' * 5000},").replace(",60", f",{'9' * 5000}")).encode(),
    "nan": (HEADER + ROWS.replace(",1,", ",nan,").replace(",60", ",nan")).encode(),
    "an open quote": (HEADER + '\n"' + ROWS).encode(),
    "old Mac lines": (HEADER + ROWS).replace(",1,", ",one,").replace(",60", ",x").replace("\n", "\r").encode(),
    "deep JSON": b"[" * DEEP + b"]" * DEEP,
    "deep JSON objects": b'{"parameters":' * DEEP + b"1" + b"}" * DEEP,
    "deep TOML": b"a = " + b"[" * DEEP + b"]" * DEEP,
    "deep TOML keys": ("[" + ".".join("a" * 20_000) + "]\nb = 1\n").encode(),
    "huge JSON number": b'{"format": 1, "model": "TubularDEA", "parameters": {"C_1": ' + b"9" * 5000 + b"}}",
    "large JSON number": b'{"format": 1, "model": "TubularDEA", "parameters": {"C_1": ' + b"9" * 400 + b"}}",
    "infinite JSON number": b'{"format": 1, "model": "TubularDEA", "parameters": {"C_1": 1e999}}',
    "JSON of other types": b'{"format": 1, "model": ["TubularDEA"], "effects": 7, "parameters": [[]]}',
    "JSON unit of another type": b'{"format":1,"model":"TubularDEA","parameters":{"C_1":{"value":1,"unit":[1]}}}',
    "JSON unit huge": b'{"format":1,"model":"TubularDEA","parameters":{"C_1":{"value":1,"unit":"m999999999"}}}',
    "a JSON list": b"[1, 2, 3]",
    "huge TOML number": b"[geometry]\nr_o = " + b"9" * 5000 + b"\n",
    "TOML of other types": b"geometry = 1\nnoise = [1]\nvary = 3\nmodel = {a = 1}\n",
    "TOML twice": b"a = 1\na = 2\n",
}

# What each reader is: its file's name, and the command that reads it.
READERS: dict[str, tuple[str, Callable[[Path, Path], list[str]]]] = {
    "protocol": ("in.csv", lambda file, out: ["simulate", "--inputs", file, "--out", out]),
    "bench": ("data/a.csv", lambda file, out: ["identify", file.parent, "--out", out]),
    "bench.toml": ("data/bench.toml", lambda file, out: ["identify", file.parent, "--out", out]),
    "model.json": ("model.json", lambda file, out: ["build", "--model", file, "--out", out]),
    "plan": ("plan.toml", lambda file, out: ["sweep", file, "--out", out, "--no-report"]),
    "plan's table": ("table.csv", lambda file, out: _plan(file, out, f'x = {{ file = "{file.name}" }}')),
    "plan's record": (
        "record.csv",
        lambda file, out: _plan(file, out, "C_1 = [3e5, 4e5]", pressure=f'{{ file = "{file.name}" }}'),
    ),
    "plan's model.json": ("m.json", lambda file, out: _plan(file, out, "C_1 = [3e5, 4e5]", model=file.name)),
    "plan's FMU": ("m.fmu", lambda file, out: _plan(file, out, "C_1 = [3e5, 4e5]", model=file.name)),
    "patient": ("patient.toml", lambda file, out: ["assist", "--patient", file, "--out", out]),
    "ECG": ("ecg.csv", lambda file, out: ["assist", "--ecg", file, "--out", out]),
    "WFDB": ("ecg.hea", lambda file, out: ["assist", "--ecg", file, "--out", out]),
    "R times": ("r.csv", lambda file, out: ["assist", "--r-times", file, "--out", out]),
}

# Unusual, but inputs of a model in a form that recordings may have.
UNDERSTOOD = {("protocol", "UTF-16"), ("protocol", "decimal commas"), ("protocol", "semicolons")}


def _plan(file: Path, out: Path, vary: str, model: str = "TubularDEA", pressure: str = '"1 kPa"') -> list[str | Path]:
    """A sweep whose plan names `file`."""
    plan = file.parent / "the_plan.toml"
    text = f'model = "{model}"\n' + PLAN.replace('"1 kPa"', pressure) + vary + "\n"
    plan.write_text(text, encoding="utf-8")
    return ["sweep", plan, "--out", out, "--no-report"]


def refused(arguments: list[str | Path], folder: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What a command says that is refused in one line and writes nothing."""
    before = sorted(folder.rglob("*"))
    code = main([str(a) for a in arguments])
    error = capsys.readouterr().err
    assert code == 2, error
    assert not out.exists()
    assert sorted(folder.rglob("*")) == before, "something was written"
    lines = [line for line in error.strip().splitlines() if not line.startswith(("\r", " "))]
    assert len([line for line in lines if line.startswith("tubular-dea ")]) == 1, error
    assert "Traceback" not in error
    assert len(error) < 5000, f"{len(error)} characters: {error[:300]}"
    return error


@pytest.mark.long
@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("text", TEXTS)
def test_hostile_text(text: str, reader: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, command = READERS[reader]
    file, out = tmp_path / name, tmp_path / "out"
    file.parent.mkdir(exist_ok=True)
    if name.endswith("bench.toml"):
        (file.parent / "a.csv").write_text(BENCH)
    file.write_bytes(TEXTS[text])
    if (reader, text) in UNDERSTOOD:
        assert main([str(a) for a in command(file, out)]) == 0
        assert (out / "response.csv").exists()
        return
    refused(command(file, out), tmp_path, out, capsys)


@pytest.mark.parametrize("reader", READERS)
def test_folders_and_absent_files(reader: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name, command = READERS[reader]
    file, out = tmp_path / name, tmp_path / "out"
    file.mkdir(parents=True)
    refused(command(file, out), tmp_path, out, capsys)
    file.rmdir()
    if name != "data/bench.toml":  # which need not be there
        refused(command(file, out), tmp_path, out, capsys)


def zipped(entries: dict[str, bytes], link: str = "") -> bytes:
    """An archive with any names at all, and a symbolic link out of it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
        if link:
            entry = zipfile.ZipInfo("resources")
            entry.create_system, entry.external_attr = 3, 0o120777 << 16
            archive.writestr(entry, link)
            archive.writestr("resources/hacked", b"through the link")
    return buffer.getvalue()


ELSEWHERE = [
    "../hacked",
    "../../hacked",
    "a/../../hacked",
    "HERE/hacked",
    "C:\\hacked",
    "..\\hacked",
    "a\\..\\..\\hacked",
    "link",
]


def absolute(where: str, here: Path) -> str:
    """A name in an archive; "HERE" is the folder of the test."""
    return where.replace("HERE", str(here))


@pytest.mark.parametrize("where", ELSEWHERE)
def test_archives_cannot_write_elsewhere(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import tempfile

    inner = tmp_path / "a" / "b" / "tmp"
    inner.mkdir(parents=True)
    monkeypatch.setattr(tempfile, "tempdir", str(inner))
    content = zipped({absolute(where, tmp_path): b"!"}) if where != "link" else zipped({}, link=str(tmp_path))
    file, out = tmp_path / "m.fmu", tmp_path / "out"
    file.write_bytes(content)
    refused(_plan(file, out, "C_1 = [3e5, 4e5]", model=file.name), tmp_path, out, capsys)
    assert not list(tmp_path.rglob("hacked*"))


XML = {
    "empty": b"",
    "NUL": b"\0\0",
    "bare": b"<fmiModelDescription/>",
    "deep": b"<a>" * 100_000,
    "external entity": b'<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    b'<fmiModelDescription fmiVersion="2.0" modelName="&x;"/>',
    "billion laughs": b'<!DOCTYPE a [<!ENTITY a "'
    + b"x" * 1000
    + b'"><!ENTITY b "'
    + b"&a;" * 1000
    + b'"><!ENTITY c "'
    + b"&b;" * 1000
    + b'">]><fmiModelDescription fmiVersion="2.0" modelName="&c;"/>',
}


@pytest.mark.parametrize("xml", XML.values(), ids=XML)
def test_hostile_descriptions(xml: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = tmp_path / "m.fmu", tmp_path / "out"
    file.write_bytes(zipped({"modelDescription.xml": xml}))
    said = refused(_plan(file, out, "C_1 = [3e5, 4e5]", model=file.name), tmp_path, out, capsys)
    assert "root:" not in said


@pytest.mark.parametrize("where", [*ELSEWHERE, "no archive", *XML])
def test_the_master_refuses_hostile_fmus(where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import tempfile

    from tubular_dea.cosim.slaves import Slave, SlaveError
    from tubular_dea.emit.model_description import fmi2
    from tubular_dea.model.dea import tubular_dea

    inner = tmp_path / "a" / "b" / "tmp"
    inner.mkdir(parents=True)
    monkeypatch.setattr(tempfile, "tempdir", str(inner))
    good = {"modelDescription.xml": fmi2(tubular_dea(), "native").encode()}
    elsewhere = zipped(good | {absolute(where, tmp_path): b"!"})
    content = zipped({"modelDescription.xml": XML[where]}) if where in XML else elsewhere
    content = {"link": zipped(good, link=str(tmp_path)), "no archive": b"PK"}.get(where, content)
    file = tmp_path / "m.fmu"
    file.write_bytes(content)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(SlaveError, match="cannot be read as an FMU|cannot be instantiated"):
        Slave("tube", file)
    assert sorted(tmp_path.rglob("*")) == before, "something was written, or left behind"


def test_archives_are_read_in_two_places() -> None:
    import tubular_dea

    package = Path(tubular_dea.__file__).parent
    opening = ("fmpy.extract(", "extractall(", "read_model_description(", "unpack_archive(", "tarfile")
    found = [p for p in package.rglob("*.py") if any(word in p.read_text() for word in opening)]
    assert {p.relative_to(package).as_posix() for p in found} == {"sweep/unpacked.py", "cosim/slaves.py"}
