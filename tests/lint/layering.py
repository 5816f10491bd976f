#!/usr/bin/env python3
"""Includes point down only, and the library's headers need no more than Asio, cereal and fmt.

usage: layering.py ROOT
"""

import sys
from pathlib import Path, PurePosixPath

from cpp_tokens import files_below, read

RANK = {"core": 0, "access": 1, "database": 1, "packet": 1, "wire": 2, "transport": 3, "net": 4, "http": 5, "session": 5, "call": 6, "subscription": 6, "service": 7, "naming": 8, "component": 9, "name_server": 10, "instantiation": 10, "deployment": 11, "bag": 11, "replay": 12}
SIM_MAY = {"core", "net", "sim"}
SHARED_COMPONENTS = {"boat", "byte_stream", "coast", "foxglove_gateway", "gprs", "iridium", "iridium_mail", "mail", "seal", "postgres", "seal_store", "spending", "xbee"}  # what other components may include
FOREIGN = ("nlohmann", "spdlog", "CLI", "boost", "curl", "sqlite3.h", "openssl", "toml++", "http_parser.h", "catch2")


def target_of(root, file, quote, path):
    """Where an include of ours leads, relative to the root, or None for one of somebody else's."""
    if quote == '"':
        beside = PurePosixPath(file.parent.as_posix()) / path
        parts = []
        for part in beside.parts:
            if part == "..":
                if parts:
                    parts.pop()
            elif part != ".":
                parts.append(part)
        if (root / Path(*parts)).is_file():
            return PurePosixPath(*parts)
    for prefix in ("", "components/", "apps/", "tests/"):
        candidate = PurePosixPath(prefix + path)
        if candidate.parts[0] in ("ise", "components", "apps", "tests", "bench") and (
            prefix == "" or (root / Path(*candidate.parts)).is_file()
        ):
            return candidate
    return None


def objection(file, target):
    """Why `file` may not include `target` (both relative to the root), or None."""
    where, to = file.parts, target.parts
    if where[0] in ("tests", "bench"):
        return None
    if to[0] in ("tests", "bench"):
        return f"{where[0]}/ includes {to[0]}/"
    if where[0] == "ise":
        if to[0] != "ise":
            return f"ise/ includes {to[0]}/"
        if len(where) == 2:
            return None  # the umbrella
        if len(to) == 2:
            return "a layer includes the umbrella header"
        if where[1] == "sim":
            return None if to[1] in SIM_MAY else f"sim includes {to[1]}"
        if to[1] == "sim":
            return None if where[1] == "replay" else f"{where[1]} includes sim, which is for tests and programs"
        for layer in (where[1], to[1]):
            if layer not in RANK:
                return f"{layer} has no place in the order of layers (tests/lint/layering.py)"
        if where[1] != to[1] and RANK[to[1]] >= RANK[where[1]]:
            return f"{where[1]} includes {to[1]}, which is not below it"
        return None
    if where[0] == "components":
        if to[0] == "apps":
            return "a component includes apps/"
        if to[0] == "components" and len(to) > 2 and len(where) > 2 and to[1] != where[1] and to[1] not in SHARED_COMPONENTS:
            # Whoever uses another component's services needs its contracts, nothing else of it.
            if to[2:] != ("services.hpp",):
                return f"{where[1]} includes {'/'.join(to)}: of another component only services.hpp"
        return None
    if where[0] == "apps" and to[0] == "apps" and len(to) > 2 and to[1] != where[1]:  # what lies in apps/ itself is for all programs
        return "a program includes another program's files"
    return None


def findings(root):
    root = Path(root)
    for path in files_below(root, {".hpp", ".cpp", ".h"}):
        if path.parts[0] not in ("ise", "components", "apps"):
            continue
        source = read(root / path, str(path))
        for line, quote, include in source.includes:
            if path.parts[0] == "ise" and path.suffix != ".cpp" and include.split("/")[0] in FOREIGN:
                yield f"{path}:{line}: a header of the library includes <{include}>: only .cpp files may"
                continue
            target = target_of(root, path, quote, include)
            if target and (why := objection(PurePosixPath(path.as_posix()), target)):
                yield f"{path}:{line}: {why}"


def main():
    if len(sys.argv) != 2 or not (Path(sys.argv[1]) / "ise").is_dir():
        print("usage: layering.py ROOT", file=sys.stderr)
        return 2
    found = list(findings(sys.argv[1]))
    print(*found, f"{len(found)} findings", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
