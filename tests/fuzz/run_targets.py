#!/usr/bin/env python3
"""Runs the fuzz targets of build/fuzz/bin, some beside each other, each on a copy of its corpus; writes a table of what they did.
What a target says lies in build/fuzz/NAME.log, what it finds in build/fuzz/findings/.
Exit codes: 0 nothing found, 1 something was found or a target did not run, 2 wrong arguments, 130 interrupted."""

import argparse
import concurrent.futures
import os
import pathlib
import re
import signal
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/fuzz"


def run(name, seconds):
    """One target's row: name, seconds, processor seconds, inputs, edges covered, inputs kept, outcome."""
    grown = BUILD / "corpus" / name
    grown.mkdir(parents=True, exist_ok=True)
    log = BUILD / f"{name}.log"
    with open(log, "wb") as told:
        child = subprocess.Popen(
            [str(BUILD / "bin" / f"fuzz_{name}"), f"-max_total_time={seconds}", "-timeout=10", "-rss_limit_mb=1024", "-print_final_stats=1",
             f"-artifact_prefix={BUILD / 'findings'}/{name}-", str(grown), str(ROOT / "tests/fuzz/corpus" / name)],
            stdin=subprocess.DEVNULL, stdout=told, stderr=subprocess.STDOUT)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    said = log.read_text(errors="replace")
    ran = re.findall(r"^Done (\d+) runs in (\d+) second", said, re.M)
    inputs, lasted = ran[-1] if ran else (last(r"^#(\d+)\t", said), "")
    outcome = "nothing found" if child.returncode == 0 and ran else "stopped early" if child.returncode in (72, -signal.SIGINT) else "FAILED"
    print(f"{name}: {outcome}", flush=True)
    return (name, lasted, f"{used.ru_utime + used.ru_stime:.0f}", inputs, last(r" cov: (\d+) ", said), str(len(list(grown.iterdir()))), outcome)


def last(pattern, text):
    found = re.findall(pattern, text, re.M)
    return found[-1] if found else ""


def main():
    parser = argparse.ArgumentParser(prog="tests/fuzz/run_targets.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, required=True, help="how long each target runs")
    parser.add_argument("--jobs", type=int, default=1, help="how many run beside each other (default 1)")
    parser.add_argument("--filter", default="", help="only targets whose names match this regular expression")
    given = parser.parse_args()
    if given.seconds < 1 or given.jobs < 1:
        parser.error("--seconds and --jobs must be positive")
    try:
        wanted = re.compile(given.filter)
    except re.error as problem:
        parser.error(f"--filter is no regular expression: {problem}")
    names = sorted(one.name.removeprefix("fuzz_") for one in (BUILD / "bin").glob("fuzz_*"))
    names = [name for name in names if wanted.search(name)]
    if not names:
        print(f"no fuzz target matches {given.filter!r}; there are those of tests/fuzz/" if given.filter else "no fuzz target was built", file=sys.stderr)
        return 1
    (BUILD / "findings").mkdir(parents=True, exist_ok=True)

    # Ctrl-C reaches the targets too, which then tell what they did; nothing new is begun, and the table is still written.
    pool = concurrent.futures.ThreadPoolExecutor(given.jobs)
    rows = [pool.submit(run, name, given.seconds) for name in names]
    interrupted = False
    while True:
        try:
            pool.shutdown(wait=True, cancel_futures=interrupted)
            break
        except KeyboardInterrupt:
            interrupted = True
    rows = [one.result() for one in rows if not one.cancelled()]

    print("\n| target | s | processor s | inputs | edges | corpus | outcome |\n|---|---:|---:|---:|---:|---:|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    failed = [row[0] for row in rows if row[-1] == "FAILED"]
    if failed:
        print(f"\nFAILED: {', '.join(failed)}; see build/fuzz/NAME.log, inputs in build/fuzz/findings/", file=sys.stderr)
    return 130 if interrupted else 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
