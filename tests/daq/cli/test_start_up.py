"""A command imports what it needs only: the large packages that must be absent after it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

COMPUTING = {"scipy", "numba", "llvmlite", "matplotlib"}
SERVING = {"fastapi", "starlette", "uvicorn", "rerun", "nidaqmx", "grpc", "distributed", "pyarrow", "h5py"}
STORING = {"numpy", "pydantic", "sqlalchemy", "mcap", "google", "zstandard", "rich"}

PROGRAM = """\
import contextlib, json, sys
from daq.cli.main import main
code = 0
with contextlib.suppress(SystemExit):
    code = main()
print("\\n" + json.dumps([code, sorted({name.partition(".")[0] for name in sys.modules})]))
"""


@pytest.mark.parametrize(
    ("arguments", "expected_code", "absent"),
    [
        (["--help"], 0, COMPUTING | SERVING | STORING),
        (["mark", "knocking", "--port", "9"], 2, COMPUTING | SERVING | STORING - {"numpy"}),
        (["acknowledge", "--help"], 0, COMPUTING | SERVING | STORING),
        (["runs"], 0, COMPUTING | SERVING | {"pydantic", "multiprocessing"}),
        (["runs", "--json"], 0, COMPUTING | SERVING),
        (["annotate", "--help"], 0, COMPUTING | SERVING | {"pydantic", "rich"}),
    ],
)
def test_command_does_not_import_what_it_does_not_need(
    arguments: list[str], expected_code: int, absent: set[str], tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments],
        env=os.environ | {"RIG_DATA": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    code, modules = json.loads(done.stdout.splitlines()[-1])
    assert code == expected_code
    assert absent.isdisjoint(modules), sorted(absent & set(modules))
