#!/usr/bin/env python3
"""The checker of grants passes a history in which all held, and finds each violation that is planted in it."""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from grants import Bounds, check, read

SECOND = 1_000_000_000
BOUNDS = Bounds(superseded_s=3, silence_s=2, min_grants=5, min_acts=10)


def line(at_s: float, what: str, **more) -> str:
    return json.dumps({"at": int(at_s * SECOND), "what": what} | more)


def granted(at: float, epoch: int, holder: int, path: str = "p") -> str:
    return line(at, "granted", path=path, epoch=epoch, holder=holder)


def ended(at: float, epoch: int, path: str = "p") -> str:
    return line(at, "ended", path=path, epoch=epoch)


def began(who: str, holder: int, path: str = "p") -> str:
    return line(0, "began", who=who, path=path, holder=holder)


def acted(who: str, at: float, epoch: int, holder: int, path: str = "p") -> str:
    return line(at, "acted", who=who, path=path, epoch=epoch, holder=holder)


def withdrawn(who: str, at: float, holder: int, path: str = "p") -> str:
    return line(at, "withdrawn", who=who, path=path, holder=holder)


# One holder is cut off for 15 s and superseded, withdraws when it is back, and its successor is killed; a third takes over. Another path
# is held all the time, and its claim changes once.
GOOD = {
    "store": [granted(1, 101, 1), granted(1, 102, 9, "q"), granted(5, 102, 9, "q"), ended(16, 101), granted(16.5, 110, 2), ended(26, 110), granted(27, 120, 3)],
    "first": [began("first", 1), *(acted("first", at, 101, 1) for at in (1.5, 8, 14, 19, 21.5)), withdrawn("first", 21.6, 1)],
    "second": [began("second", 2), *(acted("second", at, 110, 2) for at in (17, 19, 22))],
    "third": [began("third", 3), *(acted("third", at, 120, 3) for at in (27.5, 29.5))],
    "other": [began("other", 9, "q"), *(acted("other", at, 102, 9, "q") for at in (1.2, 10, 20, 29.9))],
    "story": [line(5, "away", who="first"), line(20, "back", who="first"), line(23, "killed", who="second"), line(30, "end")],
}
# Which line becomes which ones, and what is to be said of it.
PLANTED = [
    ("an epoch that falls", "store", granted(27, 120, 3), [granted(27, 109, 3)], "p was granted under 109 after 110"),
    ("one epoch for two", "store", granted(5, 102, 9, "q"), [granted(5, 102, 8, "q")], "q was granted under 102 to 9 and to 8"),
    ("acting without a grant", "third", acted("third", 27.5, 120, 3), [acted("third", 27.5, 121, 3)], "third acted for p under 121, which it was never granted"),
    ("acting under the grant of another", "third", acted("third", 27.5, 120, 3), [acted("third", 27.5, 110, 3)], "third acted for p under 110, which it was never granted"),
    ("acting long after the way is back", "first", withdrawn("first", 21.6, 1), [acted("first", 23.5, 101, 1), withdrawn("first", 23.6, 1)],
     "first acted for p under 101 3.5 s after it could know"),
    ("never away, and superseded", "story", line(5, "away", who="first"), [], "first acted for p under 101 5.0 s after it could know"),
    ("acting after withdrawing", "first", withdrawn("first", 21.6, 1), [withdrawn("first", 21.6, 1), acted("first", 21.7, 101, 1)],
     "first acted for p under 101 after it had withdrawn"),
    ("a grant that is lost", "store", granted(5, 102, 9, "q"), [granted(5, 102, 9, "q"), ended(6, 102, "q")], "q lost its grant 102 of other, which was there"),
    ("a grant that ends before the lease of the absent", "story", line(5, "away", who="first"), [line(10, "away", who="first")], "p lost its grant 101 of first"),
    ("a grant that ends before its holder is killed", "story", line(23, "killed", who="second"), [line(28, "killed", who="second")], "p lost its grant 110 of second"),
    ("a grant that ends before its holder withdraws", "store", ended(26, 110), [ended(26, 110), granted(26.1, 115, 4), ended(26.2, 115)],
     "p lost its grant 115 of nobody known"),
    ("a holder that does not know its grant", "third", acted("third", 29.5, 120, 3), [], "third holds p under 120 and does not act: nothing for 2.5 s"),
    ("a holder that never acts", "other", acted("other", 29.9, 102, 9, "q"), [], "other holds q under 102 and does not act: nothing for 10.0 s"),
    ("no end", "story", line(30, "end"), [], "the history has no end"),
    ("hardly a grant", "store", granted(5, 102, 9, "q"), [], "only 4 grants"),
]


def verdict(history: dict[str, list[str]], bounds: Bounds = BOUNDS) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        for name, lines in history.items():
            Path(folder, f"{name}.grants.jsonl").write_text("".join(f"{each}\n" for each in lines))
        return check(read(Path(folder)), bounds)


def program(history: dict[str, list[str]]) -> int:
    """The exit code of the program itself."""
    with tempfile.TemporaryDirectory() as folder:
        for name, lines in history.items():
            Path(folder, f"{name}.grants.jsonl").write_text("".join(f"{each}\n" for each in lines) + '{"at": 1, "wh')
        return subprocess.run([sys.executable, "-B", Path(__file__).with_name("grants.py"), folder], capture_output=True).returncode


def main() -> int:
    failed = [f"the good history: {each}" for each in verdict(GOOD)]
    for title, name, old, new, expected in PLANTED:
        if GOOD[name].count(old) != 1:
            failed.append(f"{title}: {old} is not once in the history")
            continue
        at = GOOD[name].index(old)
        said = verdict(GOOD | {name: GOOD[name][:at] + new + GOOD[name][at + 1:]})
        if not any(expected in each for each in said):
            failed.append(f"{title}: '{expected}' was not found, but {said}")
    if (code := program(GOOD)) != 0:
        failed.append(f"the program ends with {code} on the good history")
    if (code := program(GOOD | {"store": [granted(2, 200, 7), *GOOD["store"]]})) != 1:
        failed.append(f"the program ends with {code} on a bad history")
    print("\n".join(failed) or f"{len(PLANTED) + 1} planted violations were found")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
