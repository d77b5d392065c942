"""Nothing hostile gets through the C code: inputs, clock, previews, memory, threads.

Programs of codegen/fuzz under sanitizers. A million steps: see docs/embedded.md.
"""

import json

import pytest
from c_project import SANITIZERS, build, make_project, need, run

from qpmpc.vehicle import load_vehicle

SHARED = ["bytes.c", "drive.c", "every_command.c"]
STRICT = f"-std=c99 -O1 -g {SANITIZERS} -fno-sanitize-recover=all"
SEED = "1"
# An engine that has a least power, a ramp, shortest runs and rests, takes fuel and current to start
# and must run above a speed shows more of the safety layer; few iterations leave the time to the
# seconds. Departures of four slices are finished by some trips.
VEHICLE = load_vehicle().with_settings(
    {
        "engine.start_fuel_g": 0.3,
        "engine.start_energy_j": 5e3,
        "engine.power_min_w": 2e3,
        "engine.ramp_w_per_s": 8e3,
        "engine.min_on_s": 4,
        "engine.min_off_s": 3,
        "engine.electric_max_mps": 25.0,
    }
)
SETTINGS: dict[str, object] = {"mh_qp.admm.iterations": 10, "mh_qp.admm.cold_iterations": 15}


@pytest.fixture(scope="module", params=["f32 admm", "f64 admm", "f32 osqp", "f64 osqp"])
def project(request, tmp_path_factory):
    precision, algorithm = request.param.split()
    folder = tmp_path_factory.mktemp(f"{precision}-{algorithm}")
    make_project(folder, precision, algorithm, VEHICLE, SETTINGS)
    return folder


def is_osqp(folder) -> bool:
    return (folder / "osqp").is_dir()


@pytest.mark.slow
def test_hostile_seconds_break_no_promise_and_reach_everything(project) -> None:
    """Every step keeps its promises (promises.h) and, some seconds later, all is well again."""
    need("gcc")
    steps = 1000 if is_osqp(project) else 12000
    build(project, "gcc", STRICT, "fuzz", "-DFUZZ_MAIN", "fuzz_step.c", "promises.c", *SHARED)
    fuzzed = run(project, "./fuzz", SEED, str(steps))
    assert fuzzed.returncode == 0, fuzzed.stderr
    reached = json.loads(fuzzed.stdout)
    assert reached["steps"] >= steps
    assert reached["solved"] > steps // 2
    assert all(count > 0 for count in reached["rungs"] + reached["flags"]), reached


def test_libfuzzer_finds_nothing_in_a_short_run(project) -> None:
    need("clang")
    flags = "-std=c99 -O1 -g -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all"
    build(project, "clang", flags, "libfuzz", "fuzz_step.c", "promises.c", *SHARED)
    fuzzed = run(project, "./libfuzz", "-runs=100", f"-seed={SEED}", "-max_len=512")
    assert fuzzed.returncode == 0, fuzzed.stderr[-2000:]


@pytest.mark.slow
def test_memory_of_no_controller_is_found_out_and_a_corrupted_one_recovers(project) -> None:
    need("gcc")
    build(project, "gcc", STRICT, "bad_memory", "bad_memory.c", "promises.c", *SHARED)
    tried = run(project, "./bad_memory", "2003" if is_osqp(project) else "211")
    assert tried.returncode == 0, tried.stderr


def test_nothing_is_read_before_it_is_written(project) -> None:
    """MemorySanitizer: a step depends on nothing but what mpc_init and the caller wrote."""
    need("clang")
    if is_osqp(project):
        pytest.skip("OSQP is not ours")
    flags = "-std=c99 -O1 -g -fsanitize=memory -fno-sanitize-recover=all"
    build(project, "clang", flags, "cold", "cold_start.c", *SHARED)
    driven = run(project, "./cold")
    assert driven.returncode == 0, driven.stderr


def test_two_controllers_in_two_threads_decide_as_alone(project) -> None:
    """OSQP has one workspace for all and cannot; docs/embedded.md says so."""
    need("gcc")
    if is_osqp(project):
        pytest.skip("one static workspace")
    flags = "-std=gnu99 -O1 -g -fsanitize=thread -pthread"
    build(project, "gcc", flags, "two_threads", "two_threads.c", *SHARED)
    driven = run(project, "./two_threads", "100")
    if "unexpected memory mapping" in driven.stderr:
        pytest.skip("ThreadSanitizer does not run on this kernel")
    assert (driven.returncode, driven.stdout) == (0, "equal\n"), driven.stderr
