"""The files of an S-function: all that build.m needs, linkable side by side, nothing static."""

import re
import subprocess

from s_functions import STRICT, STUB

from qpmpc.codegen.c_compiler import compiler
from qpmpc.codegen.simulink import export_s_function


def built(folder):
    """The C files that build.m names, in its order."""
    return re.findall(r"^    '(\w+\.c)', \.\.\.$", (folder / "build.m").read_text("utf-8"), re.M)


def test_all_of_them_build_into_one_program(blocks, tmp_path):
    """As for code generation, where there is no MEX file; also where a name begins as ours do."""
    for part, name in (("costate", "mpc_costate"), ("plant", "mpc_plant")):
        folder = tmp_path / name
        written = export_s_function(blocks.part(part), folder)
        assert sorted(written) == sorted(folder.iterdir())
        sources = built(folder)
        assert sources[0] == f"{name}.c"
        assert sorted(sources) == sorted(path.name for path in folder.glob("*.c"))
        command = [compiler(), *STRICT, "-O0", "-fno-pic", f"-I{STUB}", "-c", *sources]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    objects = [str(path) for path in tmp_path.glob("*/*.o")]
    model = str(tmp_path / "model.o")
    subprocess.run([compiler(), "-no-pie", "-r", "-nostdlib", "-o", model, *objects], check=True)
    found = subprocess.run(["nm", model], capture_output=True, text=True, check=True).stdout
    assert {"mpc_costate", "mpc_plant"} <= set(re.findall(r" T (\w+)$", found, re.M))
    assert re.search(r" [Rr] ", found)
    assert re.findall(r" [BbDdCcSs] \w+", found) == []  # no variable outside a block


def test_the_same_input_is_the_same_files(blocks, tmp_path):
    one, two = (
        {path.name: path.read_bytes() for path in export_s_function(blocks.part("plant"), folder)}
        for folder in (tmp_path / "one" / "plant", tmp_path / "two" / "plant")
    )
    assert one == two
