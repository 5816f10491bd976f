#!/usr/bin/env python3
"""Every header compiles on its own: it includes what it uses.

usage: headers.py ROOT BUILD_DIR [--jobs N]
Each is looked through (-fsyntax-only) with the options of a source that lies near it, from compile_commands.json.
One that passed is looked at again only when something that it includes has changed.
"""

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from cpp_tokens import files_below


def commands_of(root, build):
    """[(folder of a source, its compiler and options)]"""
    found = []
    for entry in json.loads((build / "compile_commands.json").read_text()):
        source = Path(entry["file"])
        if source.is_relative_to(build):  # made by CMake, such as the batches: options are those of the folder of its target
            source = root / str(source.relative_to(build)).split("/CMakeFiles/")[0] / source.name
        if not source.is_relative_to(root):
            continue
        words = shlex.split(entry["command"])
        if words and Path(words[0]).name == "ccache":
            words = words[1:]
        options, skip = [words[0]], False
        for word in words[1:]:
            if skip:
                skip = False
            elif word in ("-o", "-c", "-MF", "-MT", "-MQ", "-include"):
                skip = word != "-c"
            elif word != entry["file"] and word not in ("-MD", "-MMD"):
                options.append(word)
        found.append((source.parent, options))
    return found


def nearest(commands, header):
    def shared(folder):
        return sum(1 for _ in os.path.commonpath([folder, header.parent]).split(os.sep))

    return max(commands, key=lambda c: (shared(c[0]), -len(c[0].parts)))[1]


def is_fresh(stamp, options):
    try:
        first, *dependencies = stamp.read_text().split("\n")
        passed = stamp.stat().st_mtime_ns
        return first == " ".join(options) and all(os.stat(d).st_mtime_ns < passed for d in dependencies if d)
    except OSError:
        return False


def check(header, options, stamps):
    """The compiler's complaint, or an empty text."""
    stamp = stamps / (hashlib.sha256(str(header).encode()).hexdigest()[:20] + ".passed")
    if is_fresh(stamp, options):
        return ""
    rules = stamp.with_suffix(".d")
    run = subprocess.run([*options, "-fsyntax-only", "-MD", "-MF", str(rules), "-MT", "x", "-x", "c++", "-"],
                         input=f'#include "{header}"\n', text=True, capture_output=True)
    if run.returncode:
        return run.stderr
    text = rules.read_text().replace("\\\n", " ").split(":", 1)[1]
    stamp.write_text("\n".join([" ".join(options), *(d for d in shlex.split(text) if d != "-")]))
    rules.unlink()
    return ""


def main():
    arguments = argparse.ArgumentParser(description="Every header compiles on its own.")
    arguments.add_argument("root", type=Path)
    arguments.add_argument("build", type=Path)
    arguments.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    given = arguments.parse_args()
    root = given.root.resolve()
    commands = commands_of(root, given.build)
    headers = [root / p for p in files_below(root, {".hpp"})
               if p.parts[0] in ("ise", "components", "apps") or p.as_posix().startswith("tests/support/")]
    # A program that is not built here (its library is missing) cannot be looked at.
    built = {folder for folder, _ in commands}
    headers = [h for h in headers if h.relative_to(root).parts[0] != "apps" or h.parent in built]
    # One that stands in front of a header of the same name belongs to whoever includes that.
    headers = [h for h in headers if "#include_next" not in h.read_text(encoding="utf-8")]
    if not headers or not commands:
        print("headers.py: found no header, or no source in compile_commands.json", file=sys.stderr)
        return 1
    stamps = given.build / "header_lint"
    stamps.mkdir(exist_ok=True)
    failed = 0
    with ThreadPoolExecutor(given.jobs) as pool:
        for header, complaint in zip(headers, pool.map(lambda h: check(h, nearest(commands, h), stamps), headers)):
            if complaint:
                failed += 1
                print(f"{header.relative_to(root)} does not compile on its own:\n{complaint[:3000]}")
    print(f"{len(headers)} headers, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
