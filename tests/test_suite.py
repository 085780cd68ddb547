"""What the suite says of itself: skips that are allowed, faults that it notices."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections import Counter
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


def test_every_comparison_of_arrays_states_its_relative_tolerance() -> None:
    """Beside ``atol`` NumPy adds 1e-7 of the expected value: a bound of 1e-11 would be none."""
    silent = [
        f"{path.relative_to(HERE)}:{call.lineno}"
        for path in sorted(HERE.rglob("*.py"))
        for text in [path.read_text(encoding="utf-8")]
        if "close(" in text
        for call in ast.walk(ast.parse(text))
        if isinstance(call, ast.Call)
        and ast.unparse(call.func).rpartition(".")[2] in {"assert_allclose", "allclose", "isclose"}
        and ast.unparse(call.func) != "math.isclose"
        and "rtol" not in {keyword.arg for keyword in call.keywords}
    ]
    assert silent == []


VARIANTS = """
import time
import pytest

@pytest.mark.parametrize("a", range(30))
def test_many(a): ...

@pytest.mark.variants(quick=None, core="7")
@pytest.mark.parametrize("a", range(30))
def test_all_quick(a):
    begin = time.process_time()
    while time.process_time() < begin + 0.3 * (a == 7): ...

@pytest.mark.variants(core=0)
@pytest.mark.parametrize("b", range(8))
@pytest.mark.parametrize("a", range(6))
def test_no_core(a, b): ...

@pytest.mark.slow
def test_slow(): ...
"""


def passed(folder: Path, *options: str) -> tuple[list[str], str]:
    """Tests that pass in a folder of which pytest is told nothing else, and all that is printed."""
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", *options]
    printed = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder).stdout
    return re.findall(r"^PASSED .*::(.*)", printed, re.MULTILINE), printed


def test_which_variants_of_a_function_run(tmp_path: Path) -> None:
    """The first in the core suite; of what is quick twelve, with every value of each parameter; all of a file."""
    tests = tmp_path / "tests"
    tests.mkdir()
    (tmp_path / "pytest.ini").write_text("[pytest]\ntestpaths = tests\nmarkers = slow\n")
    (tests / "test_variants.py").write_text(VARIANTS)
    shutil.copy(HERE / "skips.toml", tests)
    text = (HERE / "conftest.py").read_text(encoding="utf-8")
    (tests / "conftest.py").write_text(re.sub("_ALLOWANCE = .*", "_ALLOWANCE = 0.1", text), encoding="utf-8")
    core, printed = passed(tmp_path)
    assert core == ["test_many[0]", "test_all_quick[7]"]
    assert re.findall(r"^ *[\d.]+ s  .*::(.*)", printed, re.MULTILINE) == ["test_all_quick[7]"]  # takes too long
    quick, _ = passed(tmp_path, "-m", "not slow")
    assert Counter(name.partition("[")[0] for name in quick) == {
        "test_many": 12,
        "test_all_quick": 30,
        "test_no_core": 12,
    }
    spread = [re.findall(r"\d", name) for name in quick if name.startswith("test_no_core")]
    assert [len({*values}) for values in zip(*spread, strict=True)] == [6, 8]
    everything, _ = passed(tmp_path, "tests/test_variants.py")
    assert len(everything) == 30 + 30 + 48 + 1
