"""Makes wheels and bills of materials independent of the machine that has built them.

`python3 python/portable.py FILE…` writes the folder of the sources as `/roost` in the bills of materials, which name each crate of the
workspace by its path. It then fails if a file still has a path of this machine: the folder of the sources, or those of cargo and
rustup. With `--keep-paths` it only writes the bills.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import os
import re
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BILL = re.compile(r".*\.dist-info/sboms/[^/]+\.json")


def machine_paths() -> list[Path]:
    """The folders that no release may name."""
    home = Path.home()
    folders = {"CARGO_HOME": home / ".cargo", "RUSTUP_HOME": home / ".rustup"}
    return [ROOT, *(Path(os.environ.get(name) or folder) for name, folder in folders.items())]


def without_folder(bill: bytes) -> bytes:
    """A bill of materials with `/roost` in place of the folder of the sources."""
    text = bill.decode()
    for folder in (ROOT.as_uri(), f"file://{ROOT}"):
        text = text.replace(folder, "file:///roost")
    return text.encode()


def rewrite(wheel: Path) -> None:
    """Writes the bills of a wheel anew, and its list of digests."""
    with zipfile.ZipFile(wheel) as old:
        members = [(about, old.read(about)) for about in old.infolist()]
    changed = {about.filename: without_folder(content) for about, content in members if BILL.fullmatch(about.filename)}
    partial = wheel.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as new:
        for about, content in members:
            if about.filename.endswith(".dist-info/RECORD"):
                content = _record(content.decode(), changed).encode()
            new.writestr(about, changed.get(about.filename, content))
    partial.replace(wheel)


def named_paths(file: Path) -> list[str]:
    """The paths of this machine in a file, or in the members of a wheel, each with its place."""
    if file.suffix == ".whl":
        with zipfile.ZipFile(file) as wheel:
            contents = {f"{file.name}: {name}": wheel.read(name) for name in wheel.namelist()}
    else:
        contents = {file.name: file.read_bytes()}
    found: list[str] = []
    for place, content in contents.items():
        for folder in machine_paths():
            paths = set(re.findall(re.escape(str(folder).encode()) + rb"[\x21-\x7e]*", content))
            found += [f"{place} names {path.decode()}" for path in sorted(paths)]
    return found


def _record(record: str, changed: dict[str, bytes]) -> str:
    """The list of digests of a wheel, with those of changed members."""
    lines: list[str] = []
    for line in record.splitlines():
        name = line.split(",")[0]
        if name in changed:
            digest = base64.urlsafe_b64encode(hashlib.sha256(changed[name]).digest()).rstrip(b"=").decode()
            line = f"{name},sha256={digest},{len(changed[name])}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a wheel, or a bill of materials as JSON")
    parser.add_argument("--keep-paths", action="store_true", help="do not look for paths of this machine")
    given = parser.parse_args()
    found: list[str] = []
    for file in given.files:
        if file.suffix == ".whl":
            rewrite(file)
        else:
            file.write_bytes(without_folder(file.read_bytes()))
        found += [] if given.keep_paths else named_paths(file)
    if found:
        raise SystemExit("\n".join(found))


if __name__ == "__main__":
    main()
