#!/usr/bin/env python3
"""Errors that are planted in the solver, one at a time: does the test that docs/data/planted-errors.csv names see each of them?

    python3 docs/data/planted_errors.py FOLDER [WORD ...]

copies the tracked files of the repository into FOLDER and compiles them there. First, every named test must pass. For each row of
the list with a text in `find`, the script then puts the text of `replace` in its place, runs the test of the row, and restores the
file. The error is seen if the test fails. Code that does not compile is a fault of the list, as is a text that does not occur once.

Words choose the rows in which one of them occurs. A later call with the same FOLDER compiles the dependencies no more. `--check`
looks only for the texts. Rows without a text in `find` cannot be planted by this script. The tests of the GPU plant errors in its kernels.
"""

import argparse
import csv
import json
import os
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).parents[2]
LIST = ROOT / "docs/data/planted-errors.csv"
SEEN, NOT_SEEN, NOT_RUN = "seen", "not seen", "not run"


class Fault(Exception):
    """A row of the list that cannot be tried."""


def target_of(row):
    """The test binary of a row: a file in solver/tests, or the tests within the library."""
    binary, *path = row["seen_by"].split("::")
    return binary if len(path) == 1 and (ROOT / f"solver/tests/{binary}.rs").exists() else "lib"


def rows(words):
    """Rows that can be planted and have one of the words, by test binary."""
    with LIST.open(newline="") as file:
        found = [row for row in csv.DictReader(file) if row["find"]]
    chosen = [row for row in found if not words or any(word.lower() in " ".join(row.values()).lower() for word in words)]
    return sorted(chosen, key=target_of)


def planted(row, folder):
    """The source with the error of a row."""
    source = (folder / "solver/src" / row["file"]).read_text()
    if (count := source.count(row["find"])) != 1:
        raise Fault(f"the text of \"{row['planted_error']}\" occurs {count} times in {row['file']}")
    return source.replace(row["find"], row["replace"])


def claim(folder):
    """Takes a folder of its own: errors must never get into somebody's work."""
    folder, mark = folder.resolve(), folder / ".planted-errors"
    if folder == ROOT.resolve() or folder in ROOT.resolve().parents:
        sys.exit(f"{folder} is this repository, or contains it: give an empty folder")
    if folder.exists() and any(folder.iterdir()) and not mark.exists():
        sys.exit(f"{folder} is neither empty nor from an earlier call: give an empty folder")
    folder.mkdir(parents=True, exist_ok=True)
    mark.touch()


def copy(folder):
    """Copies tracked files. Those that are alike stay as they are, so that cargo does not compile them again."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        source, copied = ROOT / name, folder / name
        if source.is_file() and not (copied.is_file() and copied.read_bytes() == source.read_bytes()):
            copied.parent.mkdir(parents=True, exist_ok=True)
            copied.write_bytes(source.read_bytes())


def build(folder, targets):
    """Compiles test binaries. Returns their paths by name, or raises a fault with the first error."""
    chosen = [word for name in targets for word in (["--lib"] if name == "lib" else ["--test", name])]
    command = ["cargo", "test", "-p", "roost-solver", "--no-run", "--message-format=json", *chosen]
    # In many small units, of which cargo compiles only those with a change.
    command += ["--config", "profile.dev.package.roost-solver.codegen-units=256", "--target-dir", folder.resolve() / "target"]
    quickly = {**os.environ, "CARGO_INCREMENTAL": "1"}
    done = subprocess.run(command, cwd=folder, env=quickly, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    messages = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode != 0:
        errors = (message["message"] for message in messages if message["reason"] == "compiler-message")
        texts = [error["message"] for error in errors if error["level"] == "error"]
        raise Fault("it does not compile: " + (texts or ["cargo failed"])[0].splitlines()[0])
    built = [message for message in messages if message.get("executable") and message["profile"]["test"]]
    return {"lib" if "lib" in one["target"]["kind"] else one["target"]["name"]: one["executable"] for one in built}


def passes(folder, binary, row, limit_s):
    """Whether the test of a row passes, and its seconds."""
    test = row["seen_by"].split("::")[-1]
    listed = subprocess.run([binary, "--list"], cwd=folder / "solver", check=True, capture_output=True, text=True).stdout
    names = [line.removesuffix(": test") for line in listed.splitlines() if line.endswith(": test")]
    names = [name for name in names if name.split("::")[-1] == test]
    if len(names) != 1:
        raise Fault(f"{len(names)} tests have the name {test}")
    start = time.monotonic()
    try:
        done = subprocess.run([binary, "--exact", names[0]], cwd=folder / "solver", capture_output=True, timeout=limit_s)
    except subprocess.TimeoutExpired:
        raise Fault(f"the test took more than {limit_s:.0f} s") from None
    return done.returncode == 0, time.monotonic() - start


def try_error(folder, row, limit_s):
    """Plants an error, and says whether its test sees it."""
    path = folder / "solver/src" / row["file"]
    sound = path.read_text()
    try:
        path.write_text(planted(row, folder))
        passed, _ = passes(folder, build(folder, [target_of(row)])[target_of(row)], row, limit_s)
        return NOT_SEEN if passed else SEEN
    except Fault as fault:
        return f"fault: {fault}"
    finally:
        path.write_text(sound)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("folder", type=pathlib.Path, nargs="?")
    arguments.add_argument("words", nargs="*")
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("--limit-s", type=float, default=300, help="time of one test; 300 by default")
    arguments.add_argument("--minutes", type=float, default=1e9, help="time after which no further error is planted")
    given = arguments.parse_args()
    chosen, start = rows(given.words), time.monotonic()
    for row in chosen:
        planted(row, ROOT)
    print(f"{len(chosen)} errors; each text occurs once", flush=True)
    if given.check or given.folder is None:
        return
    claim(given.folder)
    copy(given.folder)
    binaries = build(given.folder, sorted({target_of(row) for row in chosen}))
    for test, row in {row["seen_by"]: row for row in chosen}.items():
        passed, seconds = passes(given.folder, binaries[target_of(row)], row, given.limit_s)
        print(f"{test} {'passes' if passed else 'FAILS'} without an error in {seconds:.0f} s", flush=True)
        if not passed:
            sys.exit(1)
    began, results = time.monotonic(), []
    for row in chosen:
        if time.monotonic() - start > 60 * given.minutes:
            results.append(NOT_RUN)
            continue
        results.append(try_error(given.folder, row, given.limit_s))
        left_s = (time.monotonic() - began) / len(results) * (len(chosen) - len(results))
        place = f"{len(results)} of {len(chosen)}, {left_s / 60:.0f} min left"
        print(f"{place}: {row['file']}: {row['planted_error']}: {results[-1]}", flush=True)
    print("\n| file | error | test | result |\n|---|---|---|---|")
    for row, result in zip(chosen, results):
        print(f"| {row['file']} | {row['planted_error']} | {row['seen_by']} | {result} |")
    print(f"\n{len(results)} errors: " + ", ".join(f"{results.count(result)} {result}" for result in sorted(set(results))))
    sys.exit(any(result not in (SEEN, NOT_RUN) for result in results))


main()
