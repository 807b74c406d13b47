"""The bill of materials says what is in a build, and says the same of the same build."""

from __future__ import annotations

import hashlib
import json
import zipfile
from importlib.metadata import version
from pathlib import Path

from tubular_dea.export.bom import bill_of_materials
from tubular_dea.export.compile import host
from tubular_dea.export.package import native_fmu
from tubular_dea.model.declare import Model


def test_every_file_and_binary_is_listed(fmi2_fmu: Path, fmi3_fmu: Path, tmp_path: Path) -> None:
    copies = [tmp_path / f"fmi{n}" / path.name for n, path in ((2, fmi2_fmu), (3, fmi3_fmu))]
    for copy, path in zip(copies, (fmi2_fmu, fmi3_fmu), strict=True):
        copy.parent.mkdir()
        copy.write_bytes(path.read_bytes())
    bom = json.loads(bill_of_materials(copies, [host()], tmp_path).read_text())
    assert bom["compiler"]["version"] == version("ziglang")
    assert list(bom["platforms"]) == [host().name]
    assert set(bom["files"]) == {"fmi2/TubularDEA.fmu", "fmi3/TubularDEA.fmu"}
    for copy in copies:
        entry = bom["files"][copy.relative_to(tmp_path).as_posix()]
        assert entry["bytes"] == copy.stat().st_size
        assert entry["sha256"] == hashlib.sha256(copy.read_bytes()).hexdigest()
        with zipfile.ZipFile(copy) as archive:
            binaries = [name for name in archive.namelist() if name.startswith("binaries/")]
            assert binaries == list(entry["binaries"])
            for name in binaries:
                assert entry["binaries"][name]["sha256"] == hashlib.sha256(archive.read(name)).hexdigest()


def test_the_same_build_has_the_same_bill_and_another_model_another(
    fmi2_fmu: Path, model: Model, tmp_path: Path
) -> None:
    """A build from nothing has the same bytes (test_package.py)."""

    def bill(name: str, built: Path) -> dict:
        copy = tmp_path / name / "fmi2" / built.name
        copy.parent.mkdir(parents=True)
        copy.write_bytes(built.read_bytes())
        return json.loads(bill_of_materials([copy], [host()], tmp_path / name).read_text())

    first = bill("first", fmi2_fmu)
    assert bill("again", native_fmu(model, 2, tmp_path / "TubularDEA.fmu")) == first
    other = bill("other", native_fmu(model.with_values({"C_1": 340e3}), 2, tmp_path / "TubularDEA.fmu"))
    assert other["files"] != first["files"]
    assert {**other, "files": {}} == {**first, "files": {}}
