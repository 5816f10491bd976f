#!/usr/bin/env python3
"""The checker passes a log in which all held, and finds each violation that is planted in it; the router does what it is told."""
import random
import sys
import tempfile
from pathlib import Path

from checker import Rules, check, read
from router import Direction

SECOND = 1_000_000_000
RULES = Rules(silence_s={"last": 2, "lossless": 9}, caught_up=("last",), min_calls=3, min_packets=3)
# A publisher of six packets, of which the sixth came after a restart; three calls; a subscription that lost two packets and said so, and
# a lossless one that ended with the exact number and began again.
GOOD = {
    "provider": f"""\
0 life A
{1 * SECOND} published A 1
{2 * SECOND} published A 2
{3 * SECOND} published A 3
{4 * SECOND} published A 4
{5 * SECOND} published A 5
{6 * SECOND} life B
{6 * SECOND} published B 1
{1 * SECOND} start r.1
{1 * SECOND} start r.2
""",
    "story": f"{7 * SECOND} end\n",
    "requester": f"""\
{1 * SECOND} call r.1 {2 * SECOND}
{1 * SECOND} call r.2 {2 * SECOND}
{1 * SECOND} call r.3 {2 * SECOND}
{2 * SECOND} done r.1 ok -
{2 * SECOND} done r.2 peer_lost unknown
{2 * SECOND} done r.3 timed_out not_executed
""",
    "feeder": "1 kept 2 1.1 1.2\n2 kept 1 1.3\n3 store one has 1.1 1.2\n4 store two has 1.1 1.2 1.3\n",
    "last": f"""\
0 subscribed last 64
{1 * SECOND} got A 1 0
{2 * SECOND} got A 2 0
{4 * SECOND} got A 4 1
{6 * SECOND} got B 1 unknown
""",
    "lossless": f"""\
0 subscribed lossless 64
{1 * SECOND} got A 1 0
{4 * SECOND} ended overloaded 2 fell_behind
{4 * SECOND} subscribed lossless 64
{4 * SECOND} got A 4 0
{5 * SECOND} got A 5 0
""",
}
# Which line becomes what, and what is to be said of it.
PLANTED = [
    ("a packet came twice", "last", f"{2 * SECOND} got A 2 0", f"{2 * SECOND} got A 2 0\n{2 * SECOND} got A 2 0", "where everything up to 2 had come"),
    ("backwards", "last", f"{4 * SECOND} got A 4 1", f"{4 * SECOND} got A 1 1", "where everything up to 2 had come"),
    ("a gap that nobody reported", "last", "got A 4 1", "got A 4 0", "1 missing before 4, 0 reported"),
    ("a gap too long", "last", "got A 4 1", "got A 4 3", "1 missing before 4, 3 reported"),
    ("an unknown gap without a restart", "last", "got A 4 1", "got A 4 unknown", "a gap of unknown length before 4"),
    ("a restart that nobody reported", "last", "got B 1 unknown", "got B 1 0", "instead of an unknown gap"),
    ("never published", "last", "got A 4 1", "got A 9 6", "got 9 of A, which was never published"),
    ("silence", "last", f"{6 * SECOND} got B 1 unknown", f"{9 * SECOND} got B 1 unknown", "heard nothing for 5.0 s"),
    ("silence at the end", "last", f"{4 * SECOND} got A 4 1\n{6 * SECOND} got B 1 unknown", f"{4 * SECOND} got A 4 1", "heard nothing for 3.0 s"),
    ("the last packet is missing", "last", f"{6 * SECOND} got B 1 unknown\n", "", "the last packet was B 1"),
    ("lossless goes on", "lossless", "got A 5 0", "got A 6 1", "lossless goes on behind 1 lost"),
    ("lossless goes on behind an unknown gap", "lossless", "got A 5 0", "got B 1 unknown", "lossless goes on behind a gap of unknown length before 1"),
    ("an end without a number", "lossless", "ended overloaded 2 fell_behind", "ended overloaded 0 fell_behind", "without the number of lost packets"),
    ("an end with an unknown number", "lossless", f"ended overloaded 2 fell_behind\n{4 * SECOND} subscribed lossless 64\n{4 * SECOND} got A 4 0\n{5 * SECOND} got A 5 0",
     "ended overloaded unknown x", None),  # the publisher restarted after it: nothing to say
    ("an end with too great a number", "lossless", "ended overloaded 2 fell_behind", "ended overloaded 3 fell_behind", "up to 4 had come or was reported lost"),
    ("a number beyond what there was", "lossless", "ended overloaded 2 fell_behind", "ended overloaded 20 fell_behind", "of which only 5 were published"),
    ("ran twice", "provider", "start r.2", f"start r.2\n{1 * SECOND} start r.2", "call r.2 ran 2 times"),
    ("not_executed lied", "provider", "start r.2", f"start r.2\n{1 * SECOND} start r.3", "not_executed, and ran at provider"),
    ("an expired request was started", "provider", f"{1 * SECOND} start r.2", f"{3 * SECOND} start r.2", "started call r.2 1.000 s after its deadline"),
    ("an answer without a run", "provider", f"{1 * SECOND} start r.1\n", "", "was answered and never started"),
    ("a call of nobody", "provider", "start r.2", f"start r.2\n{1 * SECOND} start x.1", "nobody made it"),
    ("no outcome", "requester", f"{2 * SECOND} done r.3 timed_out not_executed\n", "", "call r.3 had no outcome"),
    ("two outcomes", "requester", "done r.2 peer_lost unknown", f"done r.2 peer_lost unknown\n{2 * SECOND} done r.2 ok -", "two outcomes"),
    ("an outcome far too late", "requester", f"{2 * SECOND} done r.3", f"{5 * SECOND} done r.3", "3.000 s after its deadline"),
    ("nothing happened", "requester", f"{1 * SECOND} call r.3 {2 * SECOND}\n{2 * SECOND} done r.1 ok -\n{2 * SECOND} done r.2 peer_lost unknown\n{2 * SECOND} done r.3 timed_out not_executed\n",
     f"{2 * SECOND} done r.1 ok -\n{2 * SECOND} done r.2 peer_lost unknown\n", "only 2 calls were made"),
    ("hardly a packet came", "lossless", f"{4 * SECOND} got A 4 0\n{5 * SECOND} got A 5 0\n", "", "got only 1 packets"),
    ("a copy is missing", "feeder", "one has 1.1 1.2", "one has 1.1 1.3", "one: 1 of 2 packets that were acknowledged with two copies are missing, such as 1.2"),
    ("no copies at all", "feeder", "kept 2 1.1 1.2", "kept 1 1.1 1.2", "no packet was acknowledged with two copies"),
    ("a publisher skips a number", "provider", "published A 5", "published A 6", "published 6 where 5 was next"),
]


def verdict(logs: dict[str, str], rules: Rules = RULES) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in logs.items():
            Path(folder, f"{name}.log").write_text(text)
        return check(read(Path(folder)), rules)


def fates(**settings: float) -> tuple[list[list[float]], dict[str, int]]:
    """What becomes of a thousand packets of 100 bytes, one a millisecond."""
    way, counts = Direction(random.Random("1 a b"), **settings), dict.fromkeys("cut lost full reordered duplicated".split(), 0)
    return [way.times(n / 1000, 100, counts) for n in range(1000)], counts


def router_failures() -> list[str]:
    plain, _ = fates()
    lossy, counts = fates(loss=0.1, duplicate=0.1, reorder=0.1)
    slow, slow_counts = fates(rate=10_000, queue=1000)
    late, _ = fates(delay_ms=20, jitter_ms=10)
    come = [due for each in late for due in each]
    held = {
        "passes everything on at once": plain == [[n / 1000] for n in range(1000)],
        "loses, doubles and reorders a tenth": all(60 < counts[what] < 140 for what in ("lost", "duplicated", "reordered")),
        "the same seed meets the same fate": lossy == fates(loss=0.1, duplicate=0.1, reorder=0.1)[0],
        "a cut lets nothing through": fates(up=0)[1]["cut"] == 1000,
        "a tenth fits through a line of a tenth": 100 <= sum(map(len, slow)) <= 111 and slow_counts["full"] >= 889,
        "delay and jitter keep the order": come == sorted(come) and all(0.02 <= due - n / 1000 <= 0.04 for n, due in enumerate(come)),
    }
    return [f"the router: {what}" for what, true in held.items() if not true]


def main() -> int:
    failed = router_failures() + [f"the good logs: {each}" for each in verdict(GOOD)]
    for title, name, old, new, expected in PLANTED:
        if GOOD[name].count(old) != 1:
            failed.append(f"{title}: '{old}' is not once in the log")
            continue
        said = verdict(GOOD | {name: GOOD[name].replace(old, new)})
        if expected is None:
            if any("without the number" in each for each in said):
                failed.append(f"{title}: {said}")
        elif not any(expected in each for each in said):
            failed.append(f"{title}: '{expected}' was not found, but {said}")
    if "did not end" not in "".join(verdict(GOOD, Rules(must_end=("last",)))):
        failed.append("a subscription that should have ended")
    print("\n".join(failed) or f"{len(PLANTED) + 1} planted violations were found")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
