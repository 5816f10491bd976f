"""FORMAT.md §8: schema_request and schema."""
from collections import Counter
from typing import Any

import schema


class SchemaRules:
    def __init__(self, checker):
        self.on = checker
        self.asked = {name: Counter() for name in checker.sides}  # by this side, not answered yet

    def on_schema_request(self, side, frame) -> Any:
        if said := self.on.body(side, frame):
            self.on.require(len(said["fingerprints"]) <= 64, side, frame, f"it asks for {len(said['fingerprints'])}, more than 64")
            self.asked[side.name].update(said["fingerprints"])
        return said

    def on_schema(self, side, frame) -> Any:
        if not (said := self.on.body(side, frame)):
            return None
        fingerprint, waiting = said["fingerprint"], self.asked[self.on.peer(side).name]
        if self.on.require(waiting[fingerprint] > 0, side, frame, f"nobody asked for {fingerprint:#x}"):
            waiting[fingerprint] -= 1
        if not said["text"]:
            self.on.require(fingerprint not in self.used(side), side, frame, f"{fingerprint:#x} is its own, and it does not know it")
            return said
        try:
            of = schema.parse(said["text"])
        except schema.SchemaError as what:
            self.on.require(False, side, frame, str(what))
            return said
        self.on.require(schema.fingerprint(of) == fingerprint, side, frame, f"the text hashes to {schema.fingerprint(of):#x}, not {fingerprint:#x}")
        self.on.types[schema.fingerprint(of)] = of
        return said

    def used(self, side) -> set[int]:
        """The fingerprints that this side has named as its own."""
        out: set[int] = set()
        for sender, frame, said in self.on.history:
            if sender is side and said:
                if frame.name in ("introduce", "answers", "subscribed"):
                    out.update(said["fingerprints"])
                elif frame.name == "subscribe":
                    out.update(said["service"]["fingerprints"])
        return out

    def abandoned(self, side, message):
        """Nothing to forget."""
