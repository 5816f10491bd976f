#!/usr/bin/env python3
"""Decides from a history of all grants of names whether the guarantees of docs/names.md held.

usage: grants.py FOLDER      (the history is all *.grants.jsonl in it; exit codes: 0 all held, 1 something broke)

A line is one event in JSON: "at" (ns of the clock that all processes of a machine share), "what", and:
  by the store's watch   granted PATH EPOCH HOLDER (also when a claim changed)  |  ended PATH EPOCH (the key is gone)
  by a holder's process  began WHO PATH HOLDER  |  acted WHO PATH EPOCH HOLDER  |  withdrawn WHO PATH HOLDER
  by the story           away WHO (stopped, or cut off from all name servers)  |  back WHO  |  killed WHO  |  end
HOLDER is the incarnation of a component, WHO the name of its process. Watches report late, so a grant may be older than its line.
"""
import json
import sys
from dataclasses import dataclass
from pathlib import Path

SECOND = 1_000_000_000


@dataclass
class Bounds:
    superseded_s: float = 7.0  # acting under a superseded epoch goes on so long after it was superseded, or after the way was back:
    #                            one lease (2 s) after the name server was reached, for which clients try every 5 s at least
    silence_s: float = 5.0     # a holder that is neither away nor killed acts so often
    store_lease_s: float = 10.0  # a grant whose holder was away for that long may end
    min_grants: int = 1
    min_acts: int = 1


def read(folder: Path) -> list[dict]:
    events = []
    for file in sorted(Path(folder).glob("*.grants.jsonl")):
        text = file.read_text()
        events += map(json.loads, text[: text.rfind("\n") + 1].splitlines())  # a line that a kill cut off was not written
    return sorted(events, key=lambda one: one["at"])  # stable: those of one file stay in their order


class Holders:
    """Whose each holder is, when it was killed, and when its process was away."""

    def __init__(self, events: list[dict], end: int):
        self.whose: dict[int, str] = {}
        self.killed: dict[int, int] = {}
        self.spans: dict[str, list[list[int]]] = {}
        for one in events:
            if one["what"] == "began":
                self.whose[one["holder"]] = one["who"]
            elif one["what"] == "killed":
                for holder, who in self.whose.items():
                    if who == one["who"]:
                        self.killed.setdefault(holder, one["at"])
            elif one["what"] == "away":
                self.spans.setdefault(one["who"], []).append([one["at"], end])
            elif one["what"] == "back" and self.spans.get(one["who"]):
                self.spans[one["who"]][-1][1] = one["at"]

    def absence(self, who: str, when: int) -> list[int] | None:
        """Of that process, the last one that began before, over or not."""
        return next((span for span in reversed(self.spans.get(who, [])) if span[0] <= when), None)


def check(events: list[dict], bounds: Bounds = Bounds()) -> list[str]:
    """Everything that was broken, one line each; empty where all held."""
    end = next((one["at"] for one in events if one["what"] == "end"), None)
    if end is None:
        return ["the history has no end"]
    events = [one for one in events if one["at"] <= end]
    holders = Holders(events, end)
    grants = [one for one in events if one["what"] == "granted"]
    acts = [one for one in events if one["what"] == "acted"]
    wrong = [*check_epochs(grants), *check_acts(events, grants, holders, bounds), *check_losses(events, grants, holders, bounds, end)]
    if len(grants) < bounds.min_grants or len(acts) < bounds.min_acts:
        wrong.append(f"only {len(grants)} grants and {len(acts)} acts: the history proves nothing")
    return wrong


def check_epochs(grants: list[dict]) -> list[str]:
    """The epochs of a path only grow, and each has one holder."""
    wrong, last = [], {}
    for one in grants:
        before = last.get(one["path"])
        if before and one["epoch"] < before["epoch"]:
            wrong.append(f"{one['path']} was granted under {one['epoch']} after {before['epoch']}")
        elif before and one["epoch"] == before["epoch"] and one["holder"] != before["holder"]:
            wrong.append(f"{one['path']} was granted under {one['epoch']} to {before['holder']} and to {one['holder']}")
        if not before or one["epoch"] > before["epoch"]:
            last[one["path"]] = one
    return wrong


def check_acts(events: list[dict], grants: list[dict], holders: Holders, bounds: Bounds) -> list[str]:
    """Nobody acts without a grant, under an epoch that was superseded longer ago than the bound, or after withdrawing."""
    wrong, withdrawn = [], set()
    granted = {(one["path"], one["epoch"], one["holder"]) for one in grants}
    successors: dict[str, list[tuple[int, int]]] = {}
    for one in grants:
        successors.setdefault(one["path"], []).append((one["at"], one["epoch"]))
    for one in events:
        if one["what"] == "withdrawn":
            withdrawn.add((one["path"], one["holder"]))
        if one["what"] != "acted":
            continue
        who, path, epoch = one["who"], one["path"], one["epoch"]
        if (path, epoch, one["holder"]) not in granted:
            wrong.append(f"{who} acted for {path} under {epoch}, which it was never granted")
        if (path, one["holder"]) in withdrawn:
            wrong.append(f"{who} acted for {path} under {epoch} after it had withdrawn")
        superseded = min((at for at, other in successors.get(path, []) if other > epoch), default=one["at"])
        away = holders.absence(who, one["at"])
        if away and away[1] >= one["at"]:
            continue  # it cannot know
        late = (one["at"] - max(superseded, away[1] if away else 0)) / SECOND
        if late > bounds.superseded_s:
            wrong.append(f"{who} acted for {path} under {epoch} {late:.1f} s after it could know that this was superseded")
    return wrong


def check_losses(events: list[dict], grants: list[dict], holders: Holders, bounds: Bounds, end: int) -> list[str]:
    """A grant ends only by its holder's withdrawal, its death, or its absence for the length of a lease; until then it acts."""
    wrong, over, acted = [], set(), {}
    of_grant = {(one["path"], one["epoch"]): one["holder"] for one in grants}
    withdrawn = {(one["path"], one["holder"]): one["at"] for one in events if one["what"] == "withdrawn"}
    for one in events:
        grant = (one.get("path"), one.get("epoch"))
        if one["what"] == "acted":
            acted[grant] = one["at"]
        if one["what"] != "ended":
            continue
        over.add(grant)
        holder = of_grant.get(grant)
        who = holders.whose.get(holder, "nobody known")
        left = min(withdrawn.get((one["path"], holder), end + 1), holders.killed.get(holder, end + 1)) <= one["at"]
        away = holders.absence(who, one["at"])
        for_long = away and min(one["at"], away[1]) - away[0] >= (bounds.store_lease_s - 1) * SECOND
        if not left and not for_long:
            wrong.append(f"{one['path']} lost its grant {one['epoch']} of {who}, which was there")
    for one in {each["path"]: each for each in grants}.values():
        grant, holder = (one["path"], one["epoch"]), one["holder"]
        who = holders.whose.get(holder, "nobody known")
        away = holders.absence(who, end)
        if grant in over or (one["path"], holder) in withdrawn or holder in holders.killed or (away and away[1] >= end):
            continue
        silent = (end - max(acted.get(grant, one["at"]), away[1] if away else 0)) / SECOND
        if silent > bounds.silence_s:
            wrong.append(f"{who} holds {one['path']} under {one['epoch']} and does not act: nothing for {silent:.1f} s before the end")
    return wrong


if __name__ == "__main__":
    broken = check(read(Path(sys.argv[1])))
    print("\n".join(broken) or "everything held")
    sys.exit(bool(broken))
