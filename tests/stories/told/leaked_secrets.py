"""Values of environment variables stay with the instantiation server: nothing that it answers, logs or lets others read holds one, or a mark
that could be guessed."""
import json
import stat

from world import Failed, Rules, World

FIRST, SECOND = "hunter2-first", "hunter2-second"


def tell(world: World):
    world.name_server("--fresh")
    programs, state = world.folder / "programs", world.folder / "state"
    programs.mkdir()
    (programs / "ise_trouble").symlink_to(world.bin / "ise_trouble")
    world.run("host", ["ise_instantiation_server", "--programs", programs, "--state", state, "--name", "here", "--name-server", world.names,
                       "--log-level", "debug"]).line("ise/host/here")
    started = world.ise("--json", "--wait", "start", "trouble", "sea/box", "--env", f"TROUBLE_FLAG={FIRST}")
    if started.returncode != 0:
        raise Failed(f"sea/box does not start: {started.stderr}")
    told = [started.stdout + started.stderr]

    def flag() -> str:
        return json.dumps(world.call("sea/box", "ask", {}, wait=10))

    def asks(service: str, request: dict):
        ran = world.ise("--json", "call", "ise/host/here", service, json.dumps(request))
        told.append(ran.stdout + ran.stderr)
        return json.loads(ran.stdout) if ran.returncode == 0 else {}

    def wanted(value: str) -> dict:
        return {"type": "trouble", "path": "sea/box", "variables": [{"name": "TROUBLE_FLAG", "value": value}]}

    world.expect(FIRST in flag(), f"the component does not have its variable: {flag()}")
    asks("ise.host.instances", {})
    changed = asks("ise.host.change", {"to": wanted(SECOND)})
    world.expect(changed.get("way") == "restarted", f"the variable is not changed: {changed}")
    world.expect(world.until(lambda: SECOND in flag(), 10), f"the component does not have its new variable: {flag()}")
    # What it was can be had back by somebody who does not know it.
    undone = asks("ise.host.change", {"to": {"path": "sea/box"}, "undo": changed.get("undo", 0)})
    world.expect(undone.get("way") == "restarted" and world.until(lambda: FIRST in flag(), 10), f"the change is not undone: {undone}")
    for words in (["ps", "--json"], ["ps"], ["describe", "sea/box"], ["describe", "ise/host/here"], ["logs", "sea/box"], ["doctor"]):
        ran = world.ise(*words, wait=10)
        told.append(ran.stdout + ran.stderr)
    # Guessing by comparing is slow: it is refused before a word list is through.
    guesses = [asks("ise.host.check", {"wanted": [wanted(f"guess{n}")]}) for n in range(40)]
    world.expect(any("too_many" in json.dumps(each) for each in guesses), f"forty guesses in a row are compared: {guesses[-1]}")
    told += [world.processes["host"].said(), world.processes["host"].err.read_text()]
    for text in told:
        world.expect("hunter2" not in text, f"a secret is told: {text[:300]}")
    for each in state.rglob("*"):
        if each.is_file() and b"hunter2" in each.read_bytes():
            world.expect(stat.S_IMODE(each.stat().st_mode) & 0o077 == 0 or stat.S_IMODE(state.stat().st_mode) & 0o077 == 0,
                         f"{each.name} holds a secret, and others may read it")
    world.judge(Rules())
