"""The output of components stays within its bound on disk, and a full disk leaves no orphan behind."""
import os
from pathlib import Path

from world import Failed, Rules, World

BOUND = 2 * (256 << 10)  # two files of an instance (max_output_bytes)
LINE = "x" * 200


def of_program(name: str) -> list[int]:
    """Processes that run it; of this PID namespace."""
    made = []
    for each in Path("/proc").glob("[0-9]*"):
        try:
            if os.readlink(each / "exe").endswith("/" + name) and (each / "stat").read_text().rsplit(")")[-1].split()[0] != "Z":
                made.append(int(each.name))
        except OSError:
            pass
    return made


def size_of(folder: Path) -> int:
    made = 0
    for each in folder.rglob("*"):
        try:
            made += each.stat().st_blocks * 512
        except OSError:
            pass  # moved meanwhile
    return made


def open_host(world: World, state: Path, name: str):
    command = ["ise_instantiation_server", "--programs", world.folder / "programs", "--state", state, "--name", name, "--name-server", world.names,
               "--allow-path", world.folder, "--log-level", "error"]
    return world.run(name, command)


def start(world: World, path: str, *options: str):
    started = world.ise("--wait", "start", "trouble", path, *options)
    if started.returncode != 0:
        raise Failed(f"{path} does not start: {started.stderr.strip()}")


def tell(world: World):
    others = set(of_program("ise_trouble"))  # what another story of this run left behind
    world.name_server("--fresh")
    programs = world.folder / "programs"
    programs.mkdir()
    (programs / "ise_trouble").symlink_to(world.bin / "ise_trouble")

    # A flood, while the server looks now and then.
    state = world.folder / "state"
    open_host(world, state, "wide").line("ise/host/wide")
    start(world, "sea/flood", "--host", "wide")
    most = 0
    for _ in range(12):
        world.call("sea/flood", "say", {"text": LINE, "times": 20_000}, wait=20)
        most = max(most, size_of(state))
    world.expect(most <= BOUND + (256 << 10), f"wide: 48 MB of output took {most} bytes of disk, {BOUND} are allowed for its two files")

    # A full disk: the component is started again meanwhile, then its server is killed.
    disk = world.small_disk("4m")
    server = open_host(world, disk / "state", "full")
    server.line("ise/host/full")
    start(world, "sea/full", "--host", "full", "--restart", "always")
    try:
        with (disk / "filler").open("wb") as filler:
            while True:
                filler.write(b"x" * 4096)
                filler.flush()
    except OSError:
        pass
    world.call("sea/full", "say", {"text": LINE, "times": 5000}, wait=20)
    world.call("sea/full", "leave", {"code": 1}, wait=3)
    world.sleep(3)
    server.kill()
    (disk / "filler").unlink()
    server.restart()
    server.line("ise/host/full")
    world.expect(world.until(lambda: world.call("sea/full", "say", {"text": "here again", "times": 1}, wait=3) is not None, 15),
                 "sea/full does not answer after its log disk was full")
    told = world.until(lambda: "here again" in world.ise("logs", "sea/full", wait=5).stdout, 10)
    world.expect(told, "the output of sea/full is not kept any more after its log disk was full")
    for path in ("sea/full", "sea/flood"):
        stopped = world.ise("stop", path)
        world.expect(stopped.returncode == 0, f"{path} cannot be stopped: {stopped.stderr.strip()}")
    world.until(lambda: others.issuperset(of_program("ise_trouble")), 5)
    left = set(of_program("ise_trouble")) - others
    world.expect(not left, f"processes {left} of ise_trouble outlive `ise stop`")
    world.judge(Rules())
