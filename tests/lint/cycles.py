#!/usr/bin/env python3
"""Includes make no cycles among modules: a module is a header with the source of the same name.

usage: cycles.py ROOT
"""

import sys
from pathlib import Path

from cpp_tokens import files_below, read
from layering import target_of

FOLDERS = ("ise", "components", "apps", "tests")


def modules(root):
    """{module: {module that it includes: ["file:line includes file", …]}}"""
    files = {path.as_posix() for path in files_below(root, {".hpp", ".cpp", ".h"}) if path.parts[0] in FOLDERS}
    graph = {file.rpartition(".")[0]: {} for file in files}
    for file in sorted(files):
        own = file.rpartition(".")[0]
        for line, quote, include in read(root / file).includes:
            target = str(target_of(root, Path(file), quote, include))
            to = target.rpartition(".")[0]
            if target in files and to != own:
                graph[own].setdefault(to, []).append(f"{file}:{line} includes {target}")
    return graph


def cycles(graph):
    """The groups of modules that reach each other, each sorted."""
    left = set(graph)
    while ends := {one for one in left if not left & graph[one].keys()}:  # what includes nothing that is left
        left -= ends
    reach = {}
    for start in left:
        seen, open_ones = set(), [start]
        while open_ones:
            new = (left & graph[open_ones.pop()].keys()) - seen
            seen |= new
            open_ones += new
        reach[start] = seen
    groups = {tuple(sorted(other for other in reach[one] if one in reach[other])) for one in left}
    return sorted(group for group in groups if group)


def findings(graph):
    for group in cycles(graph):
        yield f"a cycle of {len(group)} modules: {' '.join(group)}"
        for one in group:
            for other in group:
                yield from (f"  {line}" for line in graph[one].get(other, []))


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "ise").is_dir():
        print("usage: cycles.py ROOT", file=sys.stderr)
        return 2
    graph = modules(Path(sys.argv[1]))
    found = list(findings(graph))
    print(*found, f"{len(graph)} modules, {len(found)} findings", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
