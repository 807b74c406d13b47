"""What is in the FMUs: files, descriptions, units, true dependencies, sources, libraries; the same bytes every time."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from binaries import Library, read
from drivers import CS, ME, Host
from tubular_dea.export.cache import compiler_environment
from tubular_dea.export.compile import PLATFORMS, host
from tubular_dea.export.package import native_fmu
from tubular_dea.model.dea import tubular_dea
from tubular_dea.model.declare import Model

SCHEMA = Path(fmpy.__file__).parent / "schema"
POINT = {"pressure": 12665.59, "voltage": 5000.0}
STATES = ["lambda_2", "lambda_2_rate", "sigma_vis1", "sigma_vis2"]


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def full(request: pytest.FixtureRequest, model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of each version with the libraries of all platforms."""
    folder = tmp_path_factory.mktemp(f"full{request.param}")
    return native_fmu(model, request.param, folder / "TubularDEA.fmu", PLATFORMS)


def contents(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as bundle:
        return {name: bundle.read(name) for name in bundle.namelist()}


def description(fmu: Path) -> etree._Element:
    return etree.fromstring(contents(fmu)["modelDescription.xml"])


def version(fmu: Path) -> int:
    return int(description(fmu).get("fmiVersion")[0])


# Files -------------------------------------------------------------------------------------------------


def test_files(full: Path) -> None:
    names = set(contents(full))
    folders = {name.rsplit("/", 1)[0] for name in names if name.startswith("binaries/")}
    if version(full) == 2:
        assert folders == {f"binaries/{p.fmi2}" for p in PLATFORMS} | {"binaries/darwin64"}
        assert {"modelDescription.xml", "model.png", "documentation/index.html", "documentation/license.txt"} <= names
    else:
        assert folders == {f"binaries/{p.fmi3}" for p in PLATFORMS}
        assert {
            "modelDescription.xml",
            "terminalsAndIcons/icon.png",
            "terminalsAndIcons/terminalsAndIcons.xml",
            "sources/buildDescription.xml",
            "documentation/index.html",
            "documentation/licenses/license.txt",
        } <= names
    assert all(not name.startswith("/") and ".." not in name for name in names)


def test_descriptions_are_valid(full: Path) -> None:
    assert validate_fmu(str(full)) == []
    files = contents(full)
    schemas = {"modelDescription.xml": f"fmi{version(full)}/fmi{version(full)}ModelDescription.xsd"}
    if version(full) == 3:
        schemas |= {
            "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
            "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
        }
    for name, schema in schemas.items():
        etree.XMLSchema(file=str(SCHEMA / schema)).assertValid(etree.fromstring(files[name]))


def test_icon(full: Path) -> None:
    icon = contents(full)["model.png" if version(full) == 2 else "terminalsAndIcons/icon.png"]
    assert icon[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack_from(">2I", icon, 16)
    assert width == height >= 64


def test_terminals_name_variables(full: Path) -> None:
    if version(full) == 2:
        pytest.skip("FMI 2.0 has no terminals")
    terminals = etree.fromstring(contents(full)["terminalsAndIcons/terminalsAndIcons.xml"])
    named = {t.get("name"): {m.get("variableName") for m in t} for t in terminals.iter("Terminal")}
    assert named == {"lumen": {"pressure", "tube_flow"}, "electrodes": {"voltage", "current"}}
    known = {v.name for v in fmpy.read_model_description(str(full)).modelVariables}
    assert set().union(*named.values()) <= known


def test_documentation_opens_offline_and_names_everything(full: Path) -> None:
    page = contents(full)["documentation/index.html"].decode()
    assert not re.search(r"(src|href)\s*=|@import|url\(", page), "nothing is loaded from elsewhere"
    etree.HTML(page)
    for variable in fmpy.read_model_description(str(full)).modelVariables:
        if variable.causality in ("parameter", "input", "output"):
            assert f"<code>{variable.name}</code>" in page, variable.name
    assert page.count("<math ") > 20


# Units ---------------------------------------------------------------------------------------------------


def test_units(full: Path) -> None:
    """Every unit that is used is declared, with the exponents and factors that its name says."""
    root = description(full)
    units = {unit.get("name"): unit for unit in root.find("UnitDefinitions")}
    used = {e.get("unit") for e in root.iter() if e.get("unit")}
    assert used <= set(units)
    exponents = {
        "Pa": {"kg": 1, "m": -1, "s": -2},
        "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
        "m": {"m": 1},
        "1": {},
        "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
        "m3/s": {"m": 3, "s": -1},
        "C": {"A": 1, "s": 1},
        "V/m": {"kg": 1, "m": 1, "s": -3, "A": -1},
        "Pa.s": {"kg": 1, "m": -1, "s": -1},
        "kg/m3": {"kg": 1, "m": -3},
        "A": {"A": 1},
        "1/s2": {"s": -2},
    }
    for name, expected in exponents.items():
        base = {k: int(v) for k, v in units[name].find("BaseUnit").attrib.items()}
        assert base == expected, name
    shown = {(u, d.get("name")): float(d.get("factor")) for u in units for d in units[u].iter("DisplayUnit")}
    factors = {
        ("Pa", "mmHg"): 1 / 133.322,
        ("V", "kV"): 1e-3,
        ("m", "mm"): 1e3,
        ("m3", "mL"): 1e6,
        ("Pa", "MPa"): 1e-6,
        ("m3/s", "mL/s"): 1e6,
        ("V/m", "V/um"): 1e-6,
        ("F", "nF"): 1e9,
        ("A", "uA"): 1e6,
    }
    for key, factor in factors.items():
        assert shown[key] == pytest.approx(factor, rel=1e-5), key
    for element in root.iter():
        if element.get("displayUnit"):
            assert (element.get("unit"), element.get("displayUnit")) in shown


# Dependencies ----------------------------------------------------------------------------------------------


def declared(fmu: Path) -> dict[str, dict[str, set[str]]]:
    """{section: {unknown: names it depends on}} of the model structure."""
    root = description(fmu)
    structure = root.find("ModelStructure")
    if version(fmu) == 2:
        names = [v.get("name") for v in root.find("ModelVariables")]
        rows = [(group.tag, unknown.get("index"), unknown) for group in structure for unknown in group]
        lookup = {str(i + 1): name for i, name in enumerate(names)}
    else:
        sections = {
            "Output": "Outputs",
            "ContinuousStateDerivative": "Derivatives",
            "InitialUnknown": "InitialUnknowns",
        }
        rows = [(sections[e.tag], e.get("valueReference"), e) for e in structure]
        lookup = {v.get("valueReference"): v.get("name") for v in root.find("ModelVariables")}
    table: dict[str, dict[str, set[str]]] = {}
    for section, index, unknown in rows:
        table.setdefault(section, {})[lookup[index]] = {lookup[i] for i in unknown.get("dependencies").split()}
    return table


def moved(unknown: list[str], before: list[float], after: list[float], known: str, seen: dict[str, set[str]]) -> None:
    """Note which unknowns a change of `known` has moved."""
    for name, old, new in zip(unknown, before, after, strict=True):
        if old != new:
            seen[name].add(known)


def test_dependencies_are_true(fmu: Path) -> None:
    """Perturb every input and state at a generic point: what moves is what is declared, no more, no less."""
    table = declared(fmu)
    expected = table["Outputs"] | table["Derivatives"]
    unknown = list(expected)
    seen: dict[str, set[str]] = {name: set() for name in unknown}
    with Host(fmu, ME) as tube:
        tube.initialize()
        x, u = np.array([1.3, 2.0, 4e4, 1e4]), np.array([12000.0, 5000.0])

        def values(time: float, x: np.ndarray, u: np.ndarray) -> list[float]:
            tube.place(time, x, u)
            return tube.get(*unknown)

        base = values(0.5, x, u)
        for i, name in enumerate(STATES):
            moved(unknown, base, values(0.5, x * (1 + 1e-3 * (np.arange(4) == i)), u), name, seen)
        for i, name in enumerate(POINT):
            moved(unknown, base, values(0.5, x, u * (1 + 1e-3 * (np.arange(2) == i))), name, seen)
    assert seen == expected
    assert not expected["radial_displacement"] & {"pressure", "voltage"}, "inputs reach it only through states"
    assert "voltage" in expected["electric_field"]


def test_initial_unknowns_are_complete_and_true(fmu: Path) -> None:
    """The same at initialization, with both ways to start, over all inputs and parameters.

    All that flows at the start is C dV/dt, which takes an input derivative to be seen: FMI 3.0 has none.
    """
    table = declared(fmu)
    expected = table["InitialUnknowns"]
    info = fmpy.read_model_description(str(fmu)).modelVariables
    derivatives = {v.name for v in info if v.derivative is not None}
    assert set(expected) == {v.name for v in info if v.causality == "output"} | derivatives | set(STATES)
    known = [v.name for v in info if v.causality in ("input", "parameter") and v.type in ("Real", "Float64")]
    unknown = list(expected)
    seen: dict[str, set[str]] = {name: set() for name in unknown}
    with Host(fmu, CS) as tube:
        tube.set(**POINT, lambda_2_start=1.1, phi=0.9)
        if tube.version == 2:
            tube.set_input_derivatives([0.0, 1e3])
        else:
            assert expected.pop("current") == expected["charge"]
            unknown.remove("current")
        tube.enter()
        results = []
        for rest in (False, True):
            tube.set_boolean("start_at_equilibrium", rest)
            base = tube.get(*unknown)
            results.append(base)
            for name in known:
                value = tube.get(name)[0]
                tube.set(**{name: value * 1.001})
                moved(unknown, base, tube.get(*unknown), name, seen)
                tube.set(**{name: value})
            set_layers = tube.fmu.setInteger if tube.version == 2 else tube.fmu.setInt32
            set_layers([tube.vr["n_layers"]], [9])
            moved(unknown, base, tube.get(*unknown), "n_layers", seen)
            set_layers([tube.vr["n_layers"]], [8])
        moved(unknown, *results, "start_at_equilibrium", seen)
    missing = {name: seen[name] - expected[name] for name in unknown if seen[name] - expected[name]}
    superfluous = {name: expected[name] - seen[name] for name in unknown if expected[name] - seen[name]}
    assert (missing, superfluous) == ({}, {})


# Sources -----------------------------------------------------------------------------------------------------


def run(fmu: Path) -> list[float]:
    with Host(fmu) as tube:
        tube.set(**POINT)
        tube.initialize()
        for i in range(10):
            tube.step(0.1 * i, 0.1)
        return tube.get("lambda_2", "current", "tube_volume", "snap_through_pressure")


def with_library(fmu: Path, library: Path, target: Path) -> Path:
    """The FMU with another library for this machine."""
    replaced = contents(fmu)
    folder = host().fmi2 if version(fmu) == 2 else host().fmi3
    replaced[f"binaries/{folder}/TubularDEA{host().suffix}"] = library.read_bytes()
    with zipfile.ZipFile(target, "w") as bundle:
        for name, data in replaced.items():
            bundle.writestr(name, data)
    return target


@pytest.mark.skipif(not shutil.which("gcc"), reason="compiles the sources with gcc")
def test_sources_compile_with_a_plain_compiler(fmu: Path, tmp_path: Path) -> None:
    """What a target without a shipped library does: all .c files of the sources folder, nothing else, no warning."""
    with zipfile.ZipFile(fmu) as bundle:
        bundle.extractall(tmp_path)
    sources = sorted(path.name for path in (tmp_path / "sources").glob("*.c"))
    if version(fmu) == 2:
        listed = {f.get("name") for f in description(fmu).iter("File")}
    else:
        build = etree.fromstring(contents(fmu)["sources/buildDescription.xml"])
        listed = {f.get("name") for f in build.iter("SourceFile")}
    assert listed == set(sources)
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror"]
    command = ["gcc", *strict, "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
    subprocess.run([*command, "-o", "tube.so", *sources, "-lm"], cwd=tmp_path / "sources", check=True)
    built = run(with_library(fmu, tmp_path / "sources" / "tube.so", tmp_path / "gcc.fmu"))
    assert built == pytest.approx(run(fmu), rel=1e-9)


@pytest.mark.skipif(not shutil.which("cmake") or not shutil.which("gcc"), reason="FMPy compiles with cmake")
def test_sources_compile_with_fmpy(fmu: Path, tmp_path: Path) -> None:
    from fmpy.build import build_platform_binary

    with zipfile.ZipFile(fmu) as bundle:
        bundle.extractall(tmp_path)
    shutil.rmtree(tmp_path / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(tmp_path, tmp_path / "build")
    folder = host().fmi2 if version(fmu) == 2 else host().fmi3
    library = tmp_path / "binaries" / folder / f"TubularDEA{host().suffix}"
    assert run(with_library(fmu, library, tmp_path / "cmake.fmu")) == pytest.approx(run(fmu), rel=1e-9)


# Libraries -----------------------------------------------------------------------------------------------------

SYSTEM = {
    "linux": r"lib(c|m)\.so\.6|ld-linux-aarch64\.so\.1",
    "windows": r"KERNEL32\.dll|api-ms-win-crt-\w+-l1-1-0\.dll|msvcrt\.dll",
    "macos": r"/usr/lib/libSystem\.B\.dylib",
}
LINKER = {"_mh_dylib_header", "__dso_handle"}  # the Mach-O linker's own
OLDEST = {"linux-x86_64": (2, 17), "linux-aarch64": (2, 17), "macos-x86_64": (10, 15), "macos-aarch64": (11, 0)}


def functions(fmi: int) -> set[str]:
    """Every function that the headers of an FMI version declare."""
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{fmi}FunctionTypes.h").read_text()
    return {f"fmi{fmi}{name}" for name in re.findall(rf"fmi{fmi}(\w+?)TYPE", header)}


def check_library(library: Library, platform: str, fmi: int) -> None:
    """The functions of the standard are exported and nothing else, libraries of the system needed and no newer one."""
    system, machine = platform.split("-")
    assert library.machine == machine
    assert set(library.exports) - LINKER == functions(fmi)
    assert library.needs, "it does need a C library"
    for name in library.needs:
        assert re.fullmatch(SYSTEM[system], name), name
    if system == "linux":
        assert (2, 0) < library.oldest <= OLDEST[platform]
    else:
        assert library.oldest == OLDEST.get(platform, ())
    if platform == "macos-aarch64":
        assert library.signed, "macOS runs no unsigned code on this processor"


def test_libraries(full: Path) -> None:
    files, fmi = contents(full), version(full)
    for platform in PLATFORMS:
        folder = platform.fmi2 if fmi == 2 else platform.fmi3
        (library,) = read(files[f"binaries/{folder}/TubularDEA{platform.suffix}"])
        check_library(library, platform.name, fmi)
    if fmi == 2:
        both = read(files["binaries/darwin64/TubularDEA.dylib"])
        assert [library.machine for library in both] == ["x86_64", "aarch64"]
        for library in both:
            check_library(library, f"macos-{library.machine}", fmi)


# The same bytes ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_builds_are_reproducible(full: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another folder, another working directory, a cold cache: the same bytes."""
    folder = tmp_path / "there" / "and further"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", compiler_environment()["ZIG_GLOBAL_CACHE_DIR"])
    monkeypatch.setenv("TUBULAR_DEA_CACHE", str(folder / "cache"))
    again = native_fmu(tubular_dea(), version(full), folder / "TubularDEA.fmu", PLATFORMS)
    compiled = [p for p in (folder / "cache").iterdir() if p.suffix in {t.suffix for t in PLATFORMS}]
    assert len(compiled) == len(PLATFORMS), "it was compiled anew"
    assert again.read_bytes() == full.read_bytes()
    assert str(folder).encode() not in b"".join(contents(again).values()), "no path of this machine"


def test_no_clock_in_the_archive(full: Path) -> None:
    with zipfile.ZipFile(full) as bundle:
        assert {entry.date_time for entry in bundle.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert bundle.namelist() == sorted(bundle.namelist())
    assert description(full).get("generationDateAndTime") is None


@pytest.mark.parametrize(
    "script", sorted((Path(__file__).parent / "benchmarks").glob("*.py")), ids=lambda path: path.stem
)
def test_every_benchmark_that_is_run_has_a_help(script: Path) -> None:
    text = script.read_text()
    assert "__main__" not in text or re.search(r"parser\(__doc__\)|ArgumentParser\(", text), script.name


def test_a_benchmark_tells_its_help() -> None:
    script = Path(__file__).parent / "benchmarks" / "discovery.py"
    done = subprocess.run([sys.executable, str(script), "--help"], capture_output=True, text=True, check=True)
    assert "How long a discovery takes" in done.stdout and "30k-none" in done.stdout and not done.stderr
