"""Decides from the logs of a story's processes alone whether the guarantees held (docs/guarantees.md).

A log is what one process appended (party.cpp), a line each: TIME_NS WORD VALUE..., in the clock that all processes of a machine share.
  provider    life LIFE | start ID | finish ID | published LIFE NUMBER | silent LIFE
  requester   call ID DEADLINE_NS | done ID ok|CODE -|not_executed|unknown | quiet
  story       end (the parties are about to be ended)
  subscriber  subscribed POLICY DEPTH | got LIFE NUMBER LOST|unknown | ended CODE LOST|unknown MESSAGE | refused CODE MESSAGE
  feeder      kept COPIES PACKET... (acknowledged with so many copies) | store NAME has PACKET...
By hand: checker.py FOLDER, for what holds in every story.
"""
import sys
from dataclasses import dataclass, field
from pathlib import Path

STRICT = ("lossless",)  # every packet, or the end
SECOND = 1_000_000_000


@dataclass
class Rules:
    """Exceptions and further demands of a story."""

    uncertainty_s: float = 0.25        # of "an expired request is not started"
    answer_slack_s: float = 2.0        # an outcome comes so long after its deadline at the latest
    deaf: tuple[str, ...] = ()         # requesters that were stopped themselves: their outcomes may come later
    killed: tuple[str, ...] = ()       # processes that were killed: what they had begun may have no end in their logs
    unknown_gaps: tuple[str, ...] = () # subscribers that were away for longer than the linger
    silence_s: dict[str, float] = field(default_factory=dict)  # the longest that a subscriber may hear nothing
    caught_up: tuple[str, ...] = ()    # subscribers that must have the last packet at the end
    must_end: tuple[str, ...] = ()     # subscribers whose subscription must have ended once at least
    min_calls: int = 0
    min_packets: int = 0             # that each subscriber got


@dataclass
class Log:
    name: str
    lines: list[tuple[int, str, list[str]]]

    def of(self, word: str):
        return ((at, values) for at, what, values in self.lines if what == word)


def read(folder: Path) -> list[Log]:
    logs = []
    for file in sorted(Path(folder).glob("*.log")):
        text = file.read_text()
        whole = text[: text.rfind("\n") + 1]  # a line that a kill cut off was not written
        lines = [line.split(" ") for line in whole.splitlines()]
        logs.append(Log(file.stem, [(int(words[0]), words[1], words[2:]) for words in lines]))
    return logs


def check(logs: list[Log], rules: Rules = Rules()) -> list[str]:
    """Everything that was broken, one line each; empty where all held."""
    return [*check_calls(logs, rules), *check_subscriptions(logs, rules), *check_copies(logs)]


def check_copies(logs: list[Log]) -> list[str]:
    """Packets acknowledged with two copies lie in both stores."""
    wrong = []
    for log in logs:
        safe: set[str] = set()
        for _, what, values in log.lines:
            if what == "kept" and int(values[0]) > 1:
                safe.update(values[1:])
            if what != "store":
                continue
            if not safe:
                wrong.append(f"{values[0]}: no packet was acknowledged with two copies: the story proves nothing")
            if missing := sorted(safe - set(values[2:])):
                wrong.append(f"{values[0]}: {len(missing)} of {len(safe)} packets that were acknowledged with two copies are missing, such as {missing[0]}")
    return wrong


def check_calls(logs: list[Log], rules: Rules) -> list[str]:
    wrong, starts, calls = [], {}, 0
    for log in logs:
        for at, (call,) in log.of("start"):
            starts.setdefault(call, []).append((at, log.name))
    known = set()
    for log in logs:
        deadlines = {values[0]: int(values[1]) for _, values in log.of("call")}
        outcomes = {}
        for at, (call, outcome, executed) in log.of("done"):
            if call in outcomes:
                wrong.append(f"{log.name}: call {call} had two outcomes")
            outcomes[call] = (at, outcome, executed)
        calls += len(deadlines)
        known |= deadlines.keys()
        for call, deadline in deadlines.items():
            ran = starts.get(call, [])
            if len(ran) > 1:
                wrong.append(f"call {call} ran {len(ran)} times, at {', '.join(name for _, name in ran)}")
            for at, name in ran:
                late = (at - deadline) / SECOND
                if late > rules.uncertainty_s:
                    wrong.append(f"{name} started call {call} {late:.3f} s after its deadline")
            if call not in outcomes:
                if log.name not in rules.killed:
                    wrong.append(f"{log.name}: call {call} had no outcome")
                continue
            at, outcome, executed = outcomes[call]
            if executed == "not_executed" and ran:
                wrong.append(f"{log.name}: call {call} ended as {outcome}, not_executed, and ran at {ran[0][1]}")
            if outcome == "ok" and not ran:
                wrong.append(f"{log.name}: call {call} was answered and never started")
            late = (at - deadline) / SECOND
            if late > rules.answer_slack_s and log.name not in rules.deaf:
                wrong.append(f"{log.name}: call {call} had its outcome {late:.3f} s after its deadline")
    wrong += [f"call {call} ran and nobody made it" for call in starts.keys() - known]
    if calls < rules.min_calls:
        wrong.append(f"only {calls} calls were made: the story proves nothing with fewer than {rules.min_calls}")
    return wrong


def check_subscriptions(logs: list[Log], rules: Rules) -> list[str]:
    wrong = []
    published: dict[str, list[int]] = {}  # the time of each packet of a life, from number 1 on
    for log in logs:
        for at, (life, number) in log.of("published"):
            times = published.setdefault(life, [])
            times.append(at)
            if int(number) != len(times):
                wrong.append(f"{log.name}: published {number} where {len(times)} was next")
    over = max((at for log in logs for at, _ in log.of("end")), default=0)
    last_of = {}  # of the provider that a life is of, its last one
    for log in logs:
        lives = list(dict.fromkeys(values[0] for _, values in log.of("published")))
        last_of |= dict.fromkeys(lives, lives[-1] if lives else None)
    for log in logs:
        if any(what in ("subscribed", "refused") for _, what, _ in log.lines):
            heard_of = [values[0] for _, values in log.of("got")]
            wrong += check_subscriber(log, rules, published, last_of.get(heard_of[-1]) if heard_of else None, over)
    return wrong


def check_subscriber(log: Log, rules: Rules, published: dict[str, list[int]], last_life: str | None, over: int) -> list[str]:
    wrong, got, ends, strict = [], 0, 0, False
    before: tuple[str, int] | None = None  # the packet before, of this subscription
    promised: tuple[str, int] | None = None  # what came or was reported lost, over all subscriptions
    heard: int | None = None
    quiet = (0, 0)
    def known_lost(at: int, life: str, number: int, lost: int):
        if number + lost > len(published.get(life, [])) + 1:  # one may have been published and not written down
            wrong.append(f"{log.name}: reports {lost} lost behind {number} of {life} at {at}, of which only {len(published.get(life, []))} were published")
    for at, what, values in log.lines:
        if what == "subscribed":
            strict, before = values[0] in STRICT, None
        elif what == "got":
            life, number, lost = values[0], int(values[1]), values[2]
            got += 1
            if heard is not None:
                quiet = max(quiet, (at - heard, heard))
            heard = at
            if number > len(published.get(life, [])) + 1:
                wrong.append(f"{log.name}: got {number} of {life}, which was never published")
            if promised and promised[0] == life and number <= promised[1]:
                wrong.append(f"{log.name}: got {number} where everything up to {promised[1]} had come or was reported lost")
            if lost == "unknown":
                restarted = before is not None and before[0] != life
                if not restarted and log.name not in rules.unknown_gaps:
                    wrong.append(f"{log.name}: a gap of unknown length before {number}, of a publisher that did not restart")
                if strict:
                    wrong.append(f"{log.name}: lossless goes on behind a gap of unknown length before {number}")
            elif before and before[0] == life:
                if number - before[1] - 1 != int(lost):
                    wrong.append(f"{log.name}: {number - before[1] - 1} missing before {number}, {lost} reported")
                if strict and int(lost) > 0:
                    wrong.append(f"{log.name}: lossless goes on behind {lost} lost before {number}")
            elif before:
                wrong.append(f"{log.name}: went on from {before[0]} to {life} and reported {lost} lost instead of an unknown gap")
            before = promised = (life, number)
        elif what == "ended":
            ends += 1
            lost = values[1]
            if lost == "unknown":
                if before and before[0] == last_life and log.name not in rules.unknown_gaps:
                    wrong.append(f"{log.name}: ended without the number of lost packets, of a publisher that did not restart")
            elif before and strict:
                if int(lost) == 0 and sum(time < at - SECOND for time in published[before[0]][before[1]:]) > 0:
                    wrong.append(f"{log.name}: ended behind {before[1]} without the number of lost packets, and more had been published")
                known_lost(at, *before, int(lost))
                promised = (before[0], before[1] + int(lost))
            before = None
    if log.name in rules.silence_s:
        if heard is not None:
            quiet = max(quiet, (over - heard, heard))
        if quiet[0] > rules.silence_s[log.name] * SECOND:
            wrong.append(f"{log.name}: heard nothing for {quiet[0] / SECOND:.1f} s, {rules.silence_s[log.name]} s are allowed")
    if log.name in rules.caught_up and (before is None or before != (last_life, len(published.get(last_life or "", [])))):
        wrong.append(f"{log.name}: ends with {before}, the last packet was {last_life} {len(published.get(last_life or '', []))}")
    if log.name in rules.must_end and ends == 0:
        wrong.append(f"{log.name}: its subscription did not end")
    if got < rules.min_packets:
        wrong.append(f"{log.name}: got only {got} packets: the story proves nothing with fewer than {rules.min_packets}")
    return wrong


if __name__ == "__main__":
    broken = check(read(Path(sys.argv[1])))
    print("\n".join(broken) or "everything held")
    sys.exit(bool(broken))
