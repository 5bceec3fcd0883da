"""The files of a release name no path of the machine that has built them."""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "portable.py"
ROOT = SCRIPT.parents[1]
INFO = "roost-1.dist-info"
BILL = f"{INFO}/sboms/roost-python.cyclonedx.json"
CLEAN = b'{"bom-ref": "path+file:///roost/python#roost-python@1"}'


def wheel(folder: Path, code: str) -> Path:
    """A wheel as maturin writes it: a command that is executable, a bill that names the sources, and the list of digests."""
    path = folder / "roost-1-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as new:
        command = zipfile.ZipInfo("roost-1.data/scripts/roost")
        command.external_attr = 0o755 << 16
        new.writestr(command, code)
        new.writestr(BILL, f'{{"bom-ref": "path+{ROOT.as_uri()}/python#roost-python@1"}}')
        new.writestr(f"{INFO}/RECORD", f"roost-1.data/scripts/roost,sha256=x,1\n{BILL},sha256=y,1\n{INFO}/RECORD,,\n")
    return path


def portable(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True, check=False)


def test_a_bill_of_materials_names_no_folder_of_the_machine(tmp_path: Path) -> None:
    path = wheel(tmp_path, "code")
    done = portable(path)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == [path]
    with zipfile.ZipFile(path) as new:
        assert new.read(BILL) == CLEAN
        assert new.getinfo("roost-1.data/scripts/roost").external_attr >> 16 & 0o111
        record = new.read(f"{INFO}/RECORD").decode().splitlines()
    digest = base64.urlsafe_b64encode(hashlib.sha256(CLEAN).digest()).decode().rstrip("=")
    assert record == ["roost-1.data/scripts/roost,sha256=x,1", f"{BILL},sha256={digest},{len(CLEAN)}", f"{INFO}/RECORD,,"]
    bill = tmp_path / "roost.cdx.json"
    bill.write_text(f'{{"bom-ref": "path+{ROOT.as_uri()}#0.1.0"}}')
    assert portable(bill).returncode == 0 and bill.read_text() == '{"bom-ref": "path+file:///roost#0.1.0"}'


@pytest.mark.parametrize("folder", [ROOT / "solver/src/lib.rs", Path.home() / ".cargo/registry/src/x/lib.rs"], ids=["sources", "cargo"])
def test_code_with_a_path_of_the_machine_is_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CARGO_HOME", raising=False)
    path = wheel(tmp_path, f"panicked at {folder}:7")
    done = portable(path)
    assert done.returncode == 1 and f"{path.name}: roost-1.data/scripts/roost names {folder}:7" in done.stderr
    assert portable("--keep-paths", path).returncode == 0


def test_the_native_module_of_this_build_is_looked_through() -> None:
    """The build of the tests keeps its paths: they are found where they are."""
    spec = importlib.util.spec_from_file_location("portable", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    from roost import _native

    assert module.named_paths(Path(str(_native.__file__)))
