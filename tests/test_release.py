"""A release says what it is: versions that agree, a changelog that can be read, workflows that call what exists."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

spec = importlib.util.spec_from_file_location("release_notes", ROOT / "tools" / "release_notes.py")
release_notes = importlib.util.module_from_spec(spec)
spec.loader.exec_module(release_notes)

DATED = """# Changelog

## [Unreleased]

- Not yet.

## [0.2.0] - 2030-01-31

### Added

- This.

## [0.1.0] - 2029-12-01
"""


def test_the_package_and_its_citation_name_the_same_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert release_notes.disagreements(version) == []
    assert len(release_notes.disagreements("99.0.0")) == 2


def test_the_notes_of_a_release_are_its_own_section():
    assert release_notes.notes(DATED, "0.2.0") == "### Added\n\n- This.\n"


@pytest.mark.parametrize("text", [CHANGELOG, DATED.replace(" - 2030-01-31", "")], ids=["unreleased", "undated"])
def test_a_version_without_a_date_is_not_released(text):
    with pytest.raises(ValueError, match="no dated section"):
        release_notes.notes(text, "0.2.0")


def test_the_changelog_uses_the_headings_that_its_readers_know():
    sections = re.findall(r"^## (.*)$", CHANGELOG, re.M)
    assert sections[0] == "[Unreleased]"
    assert all(re.fullmatch(r"\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", section) for section in sections[1:])
    assert set(re.findall(r"^### (.*)$", CHANGELOG, re.M)) <= {
        *("Added", "Changed", "Deprecated", "Removed", "Fixed", "Security")
    }


def commands(workflow):
    """Each shell command of each step, with the values of the job's matrix put in."""
    for job in workflow["jobs"].values():
        matrix = job.get("strategy", {}).get("matrix", {})
        for step in job["steps"]:
            run = step.get("run", "")
            for name in re.findall(r"\$\{\{ matrix\.(\w+) \}\}", run):
                values = matrix.get(name) or [case[name] for case in matrix["include"]]
                run = "\n".join(run.replace(f"${{{{ matrix.{name} }}}}", str(value)) for value in values)
            yield from run.splitlines()


@pytest.mark.parametrize("path", [*WORKFLOWS, ROOT / ".ci" / "run"], ids=lambda path: path.name)
def test_what_runs_without_us_calls_only_what_exists(path):
    text = path.read_text(encoding="utf-8")
    lines = list(commands(yaml.safe_load(text))) if path.suffix == ".yml" else text.splitlines()
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    called = {
        word for line in lines if line.startswith("make ") for word in line.split()[1:] if re.match(r"[a-z-]+$", word)
    }
    files = {word for line in lines for word in re.findall(r"\b(?:tools|tests)/[\w./]+", line)}
    assert called <= targets
    assert all((ROOT / file).exists() for file in files)


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_may_read_only_unless_a_job_asks_for_more_and_ends_by_itself(path):
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        assert "timeout-minutes" in job or not any("make" in step.get("run", "") for step in job["steps"])


def test_the_portable_run_names_tests_that_are_there():
    named = re.findall(r'"(tests/[\w/.]+)(?:::(\w+))?"', (ROOT / "tools" / "portable.py").read_text(encoding="utf-8"))
    assert len(named) > 10
    for path, test in named:
        assert (ROOT / path).exists(), path
        assert not test or f"def {test}(" in (ROOT / path).read_text(encoding="utf-8"), test
