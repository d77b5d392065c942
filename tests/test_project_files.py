"""The files that tools other than ours read: they parse, and say what the project says."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import qpmpc

ROOT = Path(__file__).resolve().parents[1]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
FORM_TYPES = {"markdown", "input", "textarea", "dropdown", "checkboxes"}


PARTS = ("qpmpc", "cycles", "codegen", "verification", "docs", "examples", "tests")
TEXTS = {".py", ".j2", ".md", ".toml", ".csv", ".c", ".h", ".cfg", ".yml"}


def test_no_merge_was_left_half_done():
    files = [path for part in PARTS for path in (ROOT / part).rglob("*") if path.suffix in TEXTS]
    files += [path for path in ROOT.iterdir() if path.suffix in TEXTS or path.name == "Makefile"]
    assert len(files) > 300
    for path in files:
        text = path.read_text("utf-8", errors="replace")
        assert not re.search(r"^(<{7}|>{7}) ", text, re.MULTILINE), path


def parsed(path):
    return yaml.safe_load(path.read_text("utf-8"))


def test_citation_agrees_with_the_package():
    citation = parsed(ROOT / "CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert citation["cff-version"] == "1.2.0"
    assert citation["message"]
    assert citation["title"] == project["name"]
    assert citation["version"] == qpmpc.__version__
    assert citation["license"] == project["license"]
    assert citation["authors"] == project["authors"]


def test_citation_names_the_paper_as_the_readme_does():
    (paper,) = parsed(ROOT / "CITATION.cff")["references"]
    readme = " ".join((ROOT / "README.md").read_text("utf-8").split())
    for author in paper["authors"]:
        assert f"{author['given-names']} {author['family-names']}" in readme
    assert f"*{paper['title']}*" in readme
    assert paper["conference"]["name"] in readme
    (preprint,) = paper["identifiers"]
    assert preprint["value"] in readme
    assert paper["url"].endswith(preprint["value"].removeprefix("arXiv:"))


def test_hooks_are_targets_of_the_makefile():
    (local,) = parsed(ROOT / ".pre-commit-config.yaml")["repos"]
    assert local["repo"] == "local"
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    for hook in local["hooks"]:
        assert {"id", "name", "entry", "language"} <= hook.keys()
        make, target = hook["entry"].split()
        assert make == "make"
        assert target in targets


def test_continuous_integration_leaves_no_test_out():
    makefile = (ROOT / "Makefile").read_text("utf-8")
    chosen = re.findall(r"^(test[\w-]*):.*\n\t.*pytest -m \"?([^\"\n]+)", makefile, re.MULTILINE)
    assert chosen == [("test", "not slow"), ("test-slow", "slow")]
    commands = (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
    assert [f"make {target}" for target, _ in chosen] == commands[-2:]


def test_the_forms_are_there():
    assert [form.stem for form in FORMS] == ["bug", "cycle", "vehicle-data"]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.stem)
def test_form_is_one_that_github_takes(form):
    content = parsed(form)
    assert content["name"]
    assert content["description"]
    fields = [field for field in content["body"] if field["type"] != "markdown"]
    names = [field["id"] for field in fields]
    assert len(set(names)) == len(names)
    assert any(field.get("validations", {}).get("required") for field in fields)
    for field in content["body"]:
        assert field["type"] in FORM_TYPES
        assert field["attributes"]["value" if field["type"] == "markdown" else "label"]
        options = field["attributes"].get("options", [])
        assert (field["type"] == "dropdown") == bool(options)
        assert all(isinstance(option, str) for option in options)
