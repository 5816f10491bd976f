#!/usr/bin/env python3
"""Whether systemd understands the units of apps/systemd, and how exposed they are by its own count. 77: no systemd here.

usage: units.py FOLDER_WITH_THE_UNITS
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

MOST = {"ise-name-server": 2.0, "ise-instantiation-server": 3.0, "ise-page": 2.0}
REQUIRED = ("ProtectSystem=strict", "NoNewPrivileges=yes", "PrivateTmp=yes", "SystemCallFilter=@system-service", "LimitNOFILE=", "MemoryMax=", "TasksMax=")
SKIPPED = 77


def run(*words):
    return subprocess.run(["systemd-analyze", *words], capture_output=True, text=True, timeout=60, check=False)


def main():
    if len(sys.argv) != 2:
        print("usage: units.py FOLDER", file=sys.stderr)
        return 2
    wrong = []
    units = {file.stem: file.read_text(encoding="utf-8") for file in sorted(Path(sys.argv[1]).glob("*.service"))}
    if units.keys() != MOST.keys():
        wrong.append(f"there are {sorted(units)}")
    users = [re.search(r"^User=(.*)$", text, re.M)[1] for text in units.values()]
    if len(set(users)) != len(users) or "root" in users:
        wrong.append(f"each has a user of its own, not {users}")
    known = (Path(sys.argv[1]) / "ise.sysusers").read_text(encoding="utf-8")
    wrong += [f"ise.sysusers makes no {user}" for user in users if f"u {user} " not in known]
    wrong += [f"{name} has no {line}" for name, text in units.items() for line in REQUIRED if line not in text]
    if not shutil.which("systemd-analyze"):
        print(*wrong, "no systemd-analyze here", sep="\n")
        return 1 if wrong else SKIPPED
    with tempfile.TemporaryDirectory() as made:
        for name, text in units.items():
            file = Path(made) / f"{name}.service"
            # The programs are not installed here, nor are their users.
            file.write_text(re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", text, flags=re.M), encoding="utf-8")
            told = run("verify", "--man=no", str(file)).stderr
            # Options of a later systemd are ignored by an earlier one.
            told = [line for line in told.splitlines() if name in line and "DelegateSubgroup" not in line]
            wrong += told
            done = run("security", "--offline=true", "--no-pager", str(file))
            exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", done.stdout)
            if not exposure:
                wrong.append(f"{name}: {done.stdout[-300:]}{done.stderr}")
            elif float(exposure[1]) > MOST[name]:
                wrong.append(f"{name} has an exposure of {exposure[1]}, more than {MOST[name]}:\n{done.stdout}")
            else:
                print(f"{name}: exposure {exposure[1]}")
    print(*wrong, sep="\n", end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
