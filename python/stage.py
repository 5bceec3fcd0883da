"""Completes the package by the player of the dashboard, `roost/_player`, which git ignores.

`python3 python/stage.py` writes the player into the package of the sources, for the wheel. `python3 python/stage.py FOLDER` copies
the package into this folder, with the player, for tests. The native module comes from elsewhere in both cases.

A notebook loads the code of a widget from one text, so that the modules go into one file: it holds the source of each, and
makes an address of each when it is loaded. The modules themselves are those of the dashboard.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path

PYTHON = Path(__file__).resolve().parent
PACKAGE = PYTHON / "roost"
ENTRY = PACKAGE / "player.js"
STYLE = PYTHON.parent / "server/dashboard/style.css"

# The path of another module, in an import or a worker's address.
MODULE = re.compile(r'"(\.{1,2}/[^"\s]+\.js)"')

LOADER = """\
// Made by python/stage.py. The modules come in an order in which each follows those that it names.
const modules = %s;
const addresses = {};
for (const [name, source] of Object.entries(modules)) {
  const linked = source.replace(/"module:([^"]+)"/g, (_, other) => JSON.stringify(addresses[other]));
  addresses[name] = URL.createObjectURL(new Blob([linked], { type: "text/javascript" }));
}
export default (await import(addresses[%s])).default;
"""


def package(folder: Path) -> Path:
    """Copies the package of the sources, with the player, into a folder in place of an earlier copy. Returns the copy."""
    copy = folder / PACKAGE.name
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "_player", "_native.*.so"))
    player(copy)
    return copy


def player(package: Path = PACKAGE) -> Path:
    """Writes the player into a copy of the package, and returns its folder `_player`."""
    folder = package / "_player"
    folder.mkdir(parents=True, exist_ok=True)
    modules: dict[str, str] = {}
    _collect(ENTRY, modules, ())
    script = LOADER % (json.dumps(modules, indent=0, ensure_ascii=False), json.dumps(_name(ENTRY)))
    (folder / "player.js").write_text(script, encoding="utf-8")
    (folder / "style.css").write_text(_of_a_shadow_tree(STYLE.read_text(encoding="utf-8")), encoding="utf-8")
    return folder


def _collect(file: Path, modules: dict[str, str], importers: tuple[Path, ...]) -> None:
    """Adds a module behind all modules that it names."""
    if file in importers:
        raise SystemExit(f"{_name(file)} imports itself through other modules, which addresses cannot express")
    if _name(file) in modules:
        return
    source = file.read_text(encoding="utf-8")

    def link(match: re.Match[str]) -> str:
        other = Path(os.path.normpath(file.parent / match[1]))
        _collect(other, modules, (*importers, file))
        return f'"module:{_name(other)}"'

    linked = MODULE.sub(link, source)
    modules[_name(file)] = linked


def _name(file: Path) -> str:
    return file.relative_to(PYTHON.parent).as_posix()


def _of_a_shadow_tree(style: str) -> str:
    """The style sheet for a shadow tree, where `:host` stands for the root and the body of a page."""
    style = re.sub(r"(?m)^body(?= \{)", ":host", style)
    return re.sub(r":root(\[[^\]]*\])?", lambda match: f":host({match[1]})" if match[1] else ":host", style)


if __name__ == "__main__":
    print(package(Path(sys.argv[1])) if len(sys.argv) > 1 else player())
