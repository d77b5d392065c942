"""The release's own programs: what they find, write and refuse, without network or emulator."""

import csv
import json
import re
import subprocess
import sys
import tomllib
from importlib import util
from pathlib import Path
from types import ModuleType

import pytest
import yaml

import qpmpc
from qpmpc.codegen.generate import project_files
from qpmpc.codegen.host_library import ABI_VERSION
from qpmpc.cycles import cycle_names

ROOT = Path(__file__).resolve().parents[1]
WORKFLOW = ROOT / ".github" / "workflows" / "ci.yml"


def program(name: str) -> ModuleType:
    spec = util.spec_from_file_location(f"release_{name}", ROOT / ".ci" / "release" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


check, history, sbom = program("check"), program("history"), program("sbom")


def test_the_workflow_calls_commands_that_exist():
    jobs = yaml.safe_load(WORKFLOW.read_text("utf-8"))["jobs"]
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    commands = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    assert commands
    for command in commands:
        words = command.removeprefix("sudo ").split()
        if words[0] == "make":
            assert set(words[1:]) <= {*targets}
        else:
            assert words[0].startswith(".ci/")
            assert (ROOT / words[0]).stat().st_mode & 0o100
    systems = [job["runs-on"] for job in jobs.values()]
    systems += jobs["release"]["strategy"]["matrix"]["os"]
    assert any("ubuntu" in system for system in systems)
    assert any("macos" in system for system in systems)


def test_the_versions_of_python_agree():
    (step,) = [
        step
        for step in yaml.safe_load(WORKFLOW.read_text("utf-8"))["jobs"]["release"]["steps"]
        if "setup-python" in step.get("uses", "")
    ]
    assert sorted(step["with"]["python-version"].split()) == sorted(check.VERSIONS)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["requires-python"] == f">={check.VERSIONS[0]}"


def test_the_running_python_is_found_and_a_dead_shim_is_not(tmp_path, monkeypatch):
    shim = tmp_path / "python3.13"
    shim.write_text("#!/bin/sh\necho not installed >&2; exit 127\n")
    shim.chmod(0o755)
    monkeypatch.setattr(check, "_candidates", lambda version: iter([str(shim), sys.executable]))
    own = ".".join(map(str, sys.version_info[:2]))
    assert check.interpreters() == {own: sys.executable}


def test_a_failing_command_is_named(tmp_path):
    with pytest.raises(RuntimeError, match="it is broken"):
        check.run(sys.executable, "-c", "import sys; sys.exit('it is broken')", cwd=tmp_path)


def test_the_bill_lists_what_is_needed_with_licences():
    bill = sbom.bill()
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.6")
    assert bill == sbom.bill()
    components = {each["name"]: each for each in bill["components"]}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    for line in project["dependencies"]:
        assert components[re.split(r"[^\w-]", line)[0]]["scope"] == "required"
    assert components["casadi"]["scope"] == "optional"
    assert not {"pytest", "mypy", "qpmpc-iptm"} & components.keys()
    assert "codegen --algorithm osqp" in json.dumps(components["osqp"])
    assert "Apache" in json.dumps(components["osqp"]["licenses"])
    assert components["uplot"]["licenses"] == [{"license": {"name": "MIT"}}]
    for name in cycle_names():
        assert components[f"cycle {name}"]["licenses"]
    for each in components.values():
        (licence,) = each["licenses"][:1]
        assert licence.get("expression") or licence["license"]["name"]


def test_every_reference_of_the_bill_is_in_it():
    bill = sbom.bill()
    references = [each["bom-ref"] for each in bill["components"]]
    assert len(references) == len(set(references))
    known = {*references, bill["metadata"]["component"]["bom-ref"]}
    for each in bill["dependencies"]:
        assert {each["ref"], *each["dependsOn"]} <= known


def test_generated_code_has_osqp_only_where_it_is_said(small_values):
    files = project_files(small_values, algorithm="admm")
    assert not [name for name in files if "osqp" in name.lower()]
    assert "contains no code of OSQP" in " ".join(files["NOTICE"].split())
    files = project_files(small_values, algorithm="osqp")
    assert "Apache License" in files["osqp/LICENSE"]


@pytest.fixture(scope="module")
def small_values():
    from qpmpc.codegen.method import Method
    from qpmpc.controllers.settings import ControllerSettings
    from qpmpc.vehicle import load_vehicle

    return Method.of("mh-qp", ControllerSettings()).values(load_vehicle(), 5)


def test_the_interface_has_one_number():
    header = (ROOT / "codegen" / "runtime" / "mpc.h").read_text("utf-8")
    assert f"#define MPC_ABI_VERSION {ABI_VERSION}\n" in header


def test_the_pages_that_the_policy_refers_to_are_there():
    policy = (ROOT / "docs" / "release.md").read_text("utf-8")
    pages = set(re.findall(r"\]\(([\w./]+)[)#]", policy))
    assert len(pages) > 5
    for page in pages:
        assert (ROOT / "docs" / page).exists(), page
    assert "qpmpc.__all__" in policy
    assert "Controller" in qpmpc.__all__


ROWS = history.read_history()


def test_the_history_is_complete():
    assert (ROOT / "docs" / "images" / "history.png").read_bytes().startswith(b"\x89PNG")
    last = ROWS[-1].commit
    measures = {row.measure for row in ROWS if row.commit == last}
    for controller in history.CONTROLLERS:
        assert f"{controller} f32 step" in measures
        assert {f"{controller} above DP {name}" for name in cycle_names()} <= measures
    assert len({(row.commit, row.measure) for row in ROWS}) == len(ROWS)
    for row in ROWS:
        assert re.fullmatch(r"[0-9a-f]{10}", row.commit)
        assert float(row.value) > 0 or row.unit == "%"
        assert row.made_with or row.unit == "%"  # times name their machine


def test_the_history_is_of_this_code():
    """Instructions of the last commit in it, against those in the docs, which tests measure."""
    docs = (ROOT / "docs" / "embedded.md").read_text("utf-8")
    found = {
        "mh-qp": re.search(r"\| admm \| f32 \| \d+ \(default\) \| ([\d,]+) \|", docs),
        "mh-costate": re.search(r"`prius-nimh` \| f32 \| \d+ \(default\) \| \d+ \| ([\d,]+)", docs),
    }
    for controller, match in found.items():
        assert match is not None
        (last,) = [
            float(row.value)
            for row in ROWS
            if row.commit == ROWS[-1].commit and row.measure == f"{controller} f32 step"
        ]
        assert last == pytest.approx(float(match[1].replace(",", "")), rel=0.03), (
            "the code has changed: make history"
        )


def test_a_commit_measured_again_has_its_rows_once():
    old = [history.Row(commit, "2026-01-01", "0", "x", "%", "1", "") for commit in "ab"]
    new = [old[1]._replace(value="2")]
    rows = history.with_rows(old, new)
    assert rows == [old[0], *new]
    assert [*csv.reader(history.history_text(rows).splitlines())][1:] == [list(row) for row in rows]


def test_the_history_is_not_extended_by_what_has_no_commit(tmp_path, monkeypatch):
    def git(*words: str) -> None:
        who = ("-c", "user.name=x", "-c", "user.email=x@example.org")
        subprocess.run(["git", *who, *words], cwd=tmp_path, check=True, capture_output=True)

    for name, file in (("HISTORY", "history.csv"), ("PICTURE", "history.png")):
        monkeypatch.setattr(history, name, tmp_path / file)
    monkeypatch.setattr(history, "ROOT", tmp_path)
    (tmp_path / "code.c").write_text("1")
    git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", "x")
    assert re.fullmatch(r"[0-9a-f]{10}", history.commit_and_date()[0])
    (tmp_path / "code.c").write_text("2")
    with pytest.raises(SystemExit, match=r"commit first.*code\.c"):
        history.commit_and_date()
