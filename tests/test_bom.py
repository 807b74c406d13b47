"""The bill of materials says what is in a build, and says the same of the same build."""

from __future__ import annotations

import hashlib
import json
import zipfile
from importlib.metadata import version
from pathlib import Path

from tubular_dea.export.bom import bill_of_materials
from tubular_dea.export.compile import host


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


def test_the_same_build_gives_the_same_bill(fmi2_fmu: Path, fmi3_fmu: Path, tmp_path: Path) -> None:
    folder = fmi2_fmu.parent
    first = bill_of_materials([fmi2_fmu], [host()], folder).read_bytes()
    assert bill_of_materials([fmi2_fmu], [host()], folder).read_bytes() == first
    (folder / "bom.json").unlink()
