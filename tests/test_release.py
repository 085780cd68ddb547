"""What says which version this is says the same, and both distributions are what an index takes."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from liaisons import __date__, __version__

ROOT = Path(__file__).parents[1]


def test_changelog_and_citation_are_of_this_version() -> None:
    assert f"\n## [{__version__}] - {__date__}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {__version__}\ndate-released: {__date__}\n" in citation


@pytest.mark.slow
def test_wheel_and_sdist_are_what_an_index_takes(tmp_path: Path) -> None:
    """The wheel is built from the sdist, as pip does where there is no wheel."""

    def run(*words: object) -> str:
        command = [sys.executable, "-m", *map(str, words)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    run("hatchling", "build", "--target", "sdist", "--directory", tmp_path)
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    (source,) = (tmp_path / "unpacked").iterdir()
    run("pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path, source)
    files = sorted(path.name for path in tmp_path.iterdir() if path.is_file())
    assert files == [f"liaisons-{__version__}-py3-none-any.whl", f"liaisons-{__version__}.tar.gz"]
    assert run("twine", "check", "--strict", *(tmp_path / name for name in files)).count("PASSED") == 2
