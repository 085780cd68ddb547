"""Reference results inside FMUs, read and repeated by ``liaisons check``: fmi-ls-ref 1.0.0-beta.1, and its alpha."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest

from liaisons.base.archive import Archive
from liaisons.base.related_files import related_files
from liaisons.check import Verdict
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import OscillatorChain, Satellite, Sinusoid
from liaisons_tools.cli._reference_results import reference_verdicts

from .conftest import Cli

Edit = Callable[[str], str]

# Written by hand after the example of the standard, with whatever its schema allows.
MANIFEST_OF_OTHERS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest" fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref"
    fmi-ls:fmi-ls-version="1.0.0-beta.1" fmi-ls:fmi-ls-description="Layered Standard" more="than is read">
  <Related type="text/modelica" source="modelica/model.mo" role="model" description="Source">
    <Annotations><Annotation type="com.example"><t:by xmlns:t="com.example" who="alice"/></Annotation></Annotations>
  </Related>
  <Related source="modelDescription.xml" role="other"/>
  <Related source="../../modelDescription.xml" role="meta-data">
    <Label name="os:linux" description="of a platform"/><Label name="late"/>
  </Related>
  <Related source="https://example.org/report.pdf" role="report"/>
</fmiReferences>
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    chain = build(assemble(OscillatorChain, 3), folder, fmi="3")
    return {
        "Satellite": build(assemble(Satellite), folder),
        "Sinusoid": build(assemble(Sinusoid), folder),
        "chain": chain,
    }


def edited(fmu: Path, folder: Path, file: str, edit: Edit) -> Path:
    """A copy of an FMU, one of whose related files is changed."""
    copy, changed = folder / fmu.name, f"extra/org.fmi-standard.fmi-ls-ref/{file}"
    with ZipFile(fmu) as old, ZipFile(copy, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, edit(content.decode()) if name == changed else content)
    return copy


def replaced(old: str, new: str) -> Edit:
    def edit(text: str) -> str:
        assert old in text
        return text.replace(old, new)

    return edit


def tenfold(text: str) -> str:
    """Results of the same columns, each number ten times as large."""
    head, *rows = text.splitlines()
    cells = [row.split(",") for row in rows]
    return "\n".join([head, *(",".join([time, *(f"{10 * float(x)}" for x in rest)]) for time, *rest in cells)]) + "\n"


def repeated(path: Path) -> Verdict | str:
    """What is said of the reference results."""
    (report,) = reference_verdicts(path)
    return report


def passed(path: Path) -> bool:
    report = repeated(path)
    assert isinstance(report, Verdict)
    return report.passed


def test_check_repeats_them(liaisons: Cli, built: dict[str, Path]) -> None:
    reply = liaisons("check", built["Sinusoid"])
    assert reply.status == 0
    assert re.search(r"results as in Sinusoid_out.csv beside the largest of .* pass\n", reply.out)


@pytest.mark.parametrize("name", ["Satellite", "chain"])
def test_results_are_repeated(built: dict[str, Path], name: str) -> None:
    """With parameters and inputs of their own; with arrays in cells."""
    report = repeated(built[name])
    assert isinstance(report, Verdict)
    assert report.error < 1e-7  # nine digits of the greatest number are written
    assert report.passed


def test_results_of_the_alpha_are_repeated(built: dict[str, Path], tmp_path: Path) -> None:
    """It has no labels."""

    def older(text: str) -> str:
        return replaced("beta.1", "alpha.1")(replaced('<Label name="default-experiment"/>', "")(text))

    assert passed(edited(built["Satellite"], tmp_path, "fmi-ls-manifest.xml", older))


@pytest.mark.parametrize(
    ("file", "edit"),
    [
        ("Satellite_out.csv", replaced("\n0,1,", "\n0,1.001,")),
        ("Satellite.ssv", replaced('value="0.1"', 'value="0.2"')),
        ("fmi-ls-manifest.xml", replaced('role="testcase"', 'role="request"')),
        ("fmi-ls-manifest.xml", replaced('role="parameter"', 'role="other"')),
    ],
    ids=["a number", "a parameter", "without inputs", "without parameters"],
)
def test_results_that_are_not_those_of_the_fmu_fail(
    built: dict[str, Path], tmp_path: Path, file: str, edit: Edit
) -> None:
    assert not passed(edited(built["Satellite"], tmp_path, file, edit))
    if file == "Satellite_out.csv":  # the error stands beside the largest of its column
        small = repeated(edited(built["Sinusoid"], tmp_path, "Sinusoid_out.csv", tenfold))
        assert isinstance(small, Verdict)
        assert small.error == pytest.approx(0.9, rel=1e-6)


def test_labels_tell_experiments_apart(built: dict[str, Path], tmp_path: Path) -> None:
    """A set of parameters with another label is not taken."""
    other = '<Related source="Satellite_in.csv" role="parameter"><Label name="other"/></Related></fmiReferences>'
    edit = replaced("</fmiReferences>", other)
    assert passed(edited(built["Satellite"], tmp_path, "fmi-ls-manifest.xml", edit))


@pytest.mark.parametrize(
    ("file", "edit", "words"),
    [
        ("fmi-ls-manifest.xml", replaced("1.0.0-beta.1", "2.0.0"), "fmi-ls-ref of version 2.0.0 is not read; 1.0.0-b"),
        ("fmi-ls-manifest.xml", replaced("fmi-ls:fmi-ls-version", "version"), "fmi-ls-version"),
        ("fmi-ls-manifest.xml", replaced('role="result"', ""), "has no attribute 'role'"),
        ("fmi-ls-manifest.xml", replaced("</fmiReferences>", ""), "no element found"),
        ("Satellite_out.csv", replaced("q_x,", "q_5,"), "'q_5'"),
        ("Satellite_out.csv", replaced("\n0,", "\nzero,"), "'zero'"),
        ("Satellite_out.csv", lambda _: "", "not enough values"),
        ("Satellite.ssv", replaced('name="', 'name="no'), "'no"),
        ("Satellite.ssv", lambda _: "mass = 1", "syntax error"),
        ("Satellite_in.csv", replaced("time,", "time,no"), "'nowheel_1'"),
    ],
)
def test_what_cannot_be_read_is_named_and_left_out(
    built: dict[str, Path], tmp_path: Path, file: str, edit: Edit, *, words: str
) -> None:
    report = repeated(edited(built["Satellite"], tmp_path, file, edit))
    assert isinstance(report, str)
    assert report.startswith("reference results are left out: ")
    assert words in report


def test_manifests_of_others_are_read(built: dict[str, Path], tmp_path: Path) -> None:
    path = edited(built["Sinusoid"], tmp_path, "fmi-ls-manifest.xml", lambda _: MANIFEST_OF_OTHERS)
    with Archive(path) as archive:
        (file,) = related_files(archive)  # without those that are not there, or elsewhere
    assert (file.type, file.role) == ("application/octet-stream", "meta-data")
    assert file.member == "modelDescription.xml"
    assert file.labels == {"os:linux", "late"}


def test_what_is_written_is_read(built: dict[str, Path]) -> None:
    with Archive(built["Satellite"]) as archive:
        files = {file.role: file for file in related_files(archive)}
    assert files.keys() == {"parameter", "testcase", "result", "document"}
    assert files["document"].member == "documentation/index.html"
    assert files["result"].labels == files["parameter"].labels == files["testcase"].labels == {"default-experiment"}


def test_fmu_without_a_manifest_has_no_related_files(tmp_path: Path, built: dict[str, Path]) -> None:
    bare = tmp_path / "bare.fmu"
    with ZipFile(built["Sinusoid"]) as old, ZipFile(bare, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
    with Archive(bare) as archive:
        assert related_files(archive) == []
