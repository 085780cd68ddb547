"""Commands and lines of Python that README, CONTRIBUTING and the site show, and the places where they are tried."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PAGES = ["README.md", "CONTRIBUTING.md"] + [
    str(path.relative_to(ROOT))
    for folder in ("docs", "docs/tutorials", "docs/howto", "docs/explanation", "docs/reference")
    for path in sorted((ROOT / folder).glob("*.md"))
]


def blocks(document: str, language: str) -> list[str]:
    """The fenced blocks of a document in one language."""
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def cells(document: str) -> list[str]:
    """The cells of a page that is a notebook."""
    text = (ROOT / document).read_text(encoding="utf-8")
    return re.findall(r"^```\{code-cell\}\n(?::[^\n]*\n)*\n?(.*?)^```", text, re.DOTALL | re.MULTILINE)


def written(document: str) -> dict[str, str]:
    """The files that its cells write, by name."""
    files = [cell.removeprefix("%%writefile ").partition("\n") for cell in cells(document) if "%%writefile" in cell]
    return {name: content for name, _, content in files}


def inline_commands(document: str) -> list[str]:
    """Commands between backquotes in the running text, without repetitions; a bare program is only named."""
    text = re.sub(r"^```.*?^```", "", (ROOT / document).read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return list(dict.fromkeys(" ".join(code.split()) for code in re.findall(r"`(liaisons [^`]+)`", text)))


def console(document: str) -> list[tuple[str, str]]:
    """Commands of its console blocks, and what they are to print (nothing: anything)."""
    found: list[tuple[str, str]] = []
    for part in re.split(r"^\$ ", "".join(blocks(document, "console")), flags=re.MULTILINE)[1:]:
        line, _, printed = part.partition("\n")
        found.append((line.strip(), printed))
    return found


@dataclass(frozen=True)
class VariableReference:
    """A folder with an environment of its own, in which commands run as a user types them."""

    folder: Path
    environment: Mapping[str, str]

    def runs(self, command: str) -> str:
        """Run a command line of a shell and expect that it does; what it prints."""
        words, environment = ["bash", "-c", command], dict(self.environment)
        done = subprocess.run(
            words, cwd=self.folder, env=environment, capture_output=True, encoding="utf-8", check=False
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
        return done.stdout


def see_packages(environment: Path) -> None:
    """Let an environment see what is installed here, but not the package itself."""
    (folder,) = (environment / "lib").glob("python*/site-packages")
    here = [entry for entry in sys.path if entry and any(Path(entry).glob("*.dist-info"))]
    (folder / "shared.pth").write_text("\n".join(here))


def clone(folder: Path) -> VariableReference:
    """The files of the repository, without what was built; its environment is for the README to make."""

    def left_out(place: str, names: list[str]) -> list[str]:
        top = Path(place) == ROOT
        return [
            name
            for name in names
            if (name.startswith(".") and name != ".ci") or name in {"__pycache__", "_build"} or name.endswith(".fmu")
            or (top and name in {"dist", "build"}) or (Path(place).name == "scenarios" and name == "figures")
        ]  # fmt: skip

    shutil.copytree(ROOT, folder, ignore=left_out)
    return VariableReference(folder, _environment(folder / ".venv"))


def wheel(folder: Path) -> Path:
    """The package as others install it."""
    words = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*words, "--wheel-dir", folder, ROOT], check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


def empty_folder(folder: Path) -> VariableReference:
    """Nothing but an environment, elsewhere, in which the wheel is installed."""
    environment = folder / "environment"
    venv.create(environment, symlinks=os.name == "posix")
    words = [sys.executable, "-m", "pip", "--python", environment / "bin" / "python", "install", "--quiet", "--no-deps"]
    subprocess.run([*words, "--no-index", wheel(folder)], check=True, capture_output=True)
    see_packages(environment)
    (folder / "empty").mkdir()
    return VariableReference(folder / "empty", _environment(environment))


def empty_folder_beside_a_clone(folder: Path) -> VariableReference:
    """Nothing, elsewhere, with the installation that the tests run from, an editable one in a clone."""
    return VariableReference(folder, _environment(Path(sys.executable).parents[1]))


def _environment(folder: Path) -> dict[str, str]:
    """Variables of a user who knows nothing of this project; pip takes what is here, without looking elsewhere."""
    kept = {name: value for name, value in os.environ.items() if name not in {"LIAISONS_FMUS", "PYTHONPATH"}}
    paths = [str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]
    pip = {"PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}  # 0: none
    return kept | {"PATH": os.pathsep.join(paths), "PYTHONWARNINGS": "ignore"} | pip
