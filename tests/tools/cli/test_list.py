"""``liaisons list``, and how files of a user are loaded."""

from pathlib import Path

import pytest

from .conftest import Cli, Runs, is_misuse


def test_list_shows_every_component_with_its_coordinates(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "250")
    lines = {line.split()[0]: line for line in runs("list").splitlines()[2:] if line}
    assert {"Pendulum", "Oscillator", "Flywheel", "Swing", "CircularHoop"} <= set(lines)
    assert {"Constant", "Ramp", "Sinusoid", "SmoothStep"} <= set(lines)
    assert "theta" in lines["Pendulum"]
    assert "length, pivot_x, pivot_z" in lines["Pendulum"]


@pytest.mark.parametrize("words", ["list", "run"])
def test_scenarios_are_listed_by_theme_with_what_they_claim(runs: Runs, tmp_path: Path, words: str) -> None:
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "mine.py").write_text('"""Two is\ntwo.\n\nMore."""\nraise SystemError("it is run")\n')
    out = runs(words)
    contacts, plans = out.index("Bodies that touch: liaisons run --theme contacts\n"), out.index("The operator chooses")
    assert contacts < out.index("ball_row ") < plans < out.index("planned_swing ")
    assert out.count("\nball_row ") == 1
    assert "of 2, 1" not in out  # paragraphs after the first
    assert out.index("Of this directory: liaisons run --theme own\n") < out.index("\nmine      Two is two.\n")


def test_files_of_the_folder_are_listed_but_not_run(runs: Runs, tmp_path: Path) -> None:
    assert "In this folder" not in runs("list")
    text = 'raise SystemError("it is run")\n\n\nclass Mine(Mechanism):\n    """Two is two.\n\n    More."""\n'
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "broken.py").write_text("class Broken(Mechanism:")
    out = runs("list")
    assert out.index("In this folder: liaisons check FILE.py\n") < out.index("\nmine.py  Mine       Two is two.")
    assert "Broken" not in out


@pytest.mark.parametrize("kind", ["Mechanism", "Chain", "Linkage", "Operator", "Sampled", "Hoop", "liaisons.Sampled"])
def test_every_kind_of_component_is_listed_of_a_file(runs: Runs, tmp_path: Path, kind: str) -> None:
    text = f'class Mine({kind}):\n    """Mine is one."""\n\n\nclass Other({kind}s, dict):\n    """Other is none."""\n'
    (tmp_path / "mine.py").write_text(text)
    out = runs("list")
    assert "Mine is one." in out
    assert "Other is none." not in out


def test_list_finds_components_and_scenarios_by_words(runs: Runs, liaisons: Cli) -> None:
    def names(*words: str) -> set[str]:
        lines = runs("list", *words).splitlines()
        return {line.split()[0] for line in lines if line and line[0] not in " -"} - {"name", "scenario"}

    assert {"kapitza", "held_pendulum"} <= names("kapitza")
    assert "Pendulum" not in names("kapitza")
    assert {"CircularHoop", "driven_hoop"} <= names("bead", "Hoop") < names("bead")
    assert "Pid" in names("PID")
    assert {"observed_double_pendulum"} <= names("Kalman")  # in the second paragraph
    assert "driven_hoop" in names("driven_hoop")
    assert is_misuse(liaisons("list", "Pendulun"), "did you mean 'Pendulum'")
    assert is_misuse(liaisons("list", "Pendulum", "kapitza"), "'kapitza'")


def test_list_shows_the_components_of_a_file_but_not_its_abstract_base(runs: Runs, bead: Path) -> None:
    assert [line.split()[0] for line in runs("list", bead).splitlines()[2:]] == ["Bead", "Parabola"]
    assert [line.split()[0] for line in runs("list", f"{bead}:Parabola").splitlines()[2:]] == ["Parabola"]
    assert "free of forces" in runs("list", bead)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("x = 1\n", ["defines no component", "liaisons.Mechanism"]),
        ("def f(:\n", ["mine.py:1", "invalid syntax"]),
        ("\n\nimport nowhere_to_be_found\n", ["mine.py:3", "nowhere_to_be_found"]),
        ("from liaisons import Parameter\n\nm = Parameter(1.0, 'kilo', 'mass')\n", ["mine.py:3", "'kilo'", "kg.m2/s"]),
    ],
    ids=["nothing in it", "syntax", "import", "declaration"],
)
def test_a_bad_file_is_reported_with_line_and_reason(
    liaisons: Cli, tmp_path: Path, source: str, words: list[str]
) -> None:
    (tmp_path / "mine.py").write_text(source)
    assert is_misuse(liaisons("list", "mine.py"), *words)


def test_an_unknown_symbol_in_a_component_is_reported_where_it_stands(liaisons: Cli, bead: Path) -> None:
    source = bead.read_text().replace("self.mass / 2", "self.mas / 2")
    bead.write_text(source)
    line = 1 + source[: source.index("self.mas ")].count("\n")
    assert is_misuse(liaisons("list", bead), f"{bead}:{line}:", "self.mas;", "did you mean 'mass'")
