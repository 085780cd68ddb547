"""Every FMU of the catalogue before fmpy's validator, the schemas of the standard, and fmutool."""

from __future__ import annotations

import zipfile
from functools import cache
from pathlib import Path, PurePosixPath

import fmpy
import pytest
from fmpy.validation import validate_fmu
from fmu_manipulation_toolbox.checker import OperationGenericCheck, OperationSemanticCheck
from fmu_manipulation_toolbox.operations import FMU
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue] - compiled, without stubs
from trial import every_component, every_version

# FMI 2.0 took terminals and build description over from FMI 3.0.
_SCHEMAS = {
    "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
    "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
}
_MANIFEST = "fmi-ls-manifest.xml"  # of a layered standard; its root is that standard's own, with these attributes
_ATTRIBUTES = ("name", "version", "description")


@cache
def schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / name))


@every_version
@every_component
def test_fmpy_finds_no_problem(fmu, name, version) -> None:
    assert validate_fmu(str(fmu(name, version))) == []


@every_version
@every_component
def test_files_follow_the_schemas(fmu, name, version) -> None:
    schemas = {"modelDescription.xml": f"fmi{version}/fmi{version}ModelDescription.xsd", **_SCHEMAS}
    with zipfile.ZipFile(fmu(name, version)) as archive:
        files = {name: etree.fromstring(archive.read(name)) for name in archive.namelist() if name.endswith(".xml")}
    assert files.keys() >= {"modelDescription.xml", "sources/buildDescription.xml"}
    for file, root in files.items():
        path = PurePosixPath(file)
        if path.name == _MANIFEST:
            assert path.parts[0] == "extra"
            said = {key: root.get(f"{{http://fmi-standard.org/fmi-ls-manifest}}fmi-ls-{key}") for key in _ATTRIBUTES}
            assert all(said.values()), said
            assert said["name"] == path.parent.name
        else:
            schema(schemas[file]).assertValid(root)


@every_version
@every_component
def test_fmutool_finds_no_error(fmu, name, version, caplog: pytest.LogCaptureFixture) -> None:
    generic, semantic = OperationGenericCheck(), OperationSemanticCheck()
    for check in (generic, semantic):
        FMU(str(fmu(name, version))).apply_operation(check)
    assert generic.compliant_with_version == f"{version}.0"
    assert semantic.errors == []
    assert [record.message for record in caplog.records if record.levelname == "ERROR"] == []
