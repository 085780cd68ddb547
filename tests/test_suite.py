"""What the suite says of itself: skips that are allowed, faults that it notices."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # the module beside the tests

from faults import entries

HERE = Path(__file__).parent
SKIPS = """
import pytest

def test_of_an_allowed_reason():
    pytest.importorskip("torch_that_nobody_has", reason="could not import 'torch': no module")

def test_of_another_reason():
    pytest.skip("not today")

@pytest.mark.xfail(strict=True)
def test_that_is_expected_to_fail():
    assert False
"""


def test_a_skip_that_the_list_does_not_allow_fails(tmp_path: Path) -> None:
    for name in ("conftest.py", "skips.toml"):
        shutil.copy(HERE / name, tmp_path)
    (tmp_path / "test_skips.py").write_text(SKIPS)
    (tmp_path / "test_module.py").write_text("import pytest\npytest.importorskip('nothing_of_this_name')\n")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--rootdir={tmp_path}"]
    command += ["--continue-on-collection-errors", "-q", str(tmp_path)]
    printed = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path).stdout
    assert "1 failed, 1 skipped, 1 xfailed, 1 error" in printed
    assert "tests/skips.toml does not allow: Skipped: not today" in printed
    assert "tests/skips.toml does not allow: Skipped: could not import 'nothing_of_this_name'" in printed


def test_what_is_planted_again_is_there() -> None:
    for entry in entries():
        name, survivors = entry["package"], entry.get("survivors", {})
        assert (HERE.parent / "components/liaisons" / name).exists()
        assert entry["files"], name
        for test in entry["tests"]:
            path, _, function = test.removeprefix("--deselect=").partition("::")
            assert (HERE.parent / path).exists(), test
            assert f"def {function}(" in (HERE.parent / path).read_text(encoding="utf-8") if function else True, test
        assert entry["caught"] + len(survivors) == entry["count"], name
        assert all(survivors.values()), name
