#!/usr/bin/env python3
"""Communication nodes on a store in a real PostgreSQL, which is killed, filled, stopped and restarted.

usage: stories.py ISE NAME_SERVER ATIRMA [STORY...]
The server is Debian's, in a folder of the test's own, and listens on a Unix socket there. As it refuses to run as root,
root runs it as `postgres` or `nobody`. Exit code 77: PostgreSQL 15 or newer, or libpq in the build, is missing.
"""

import base64
import glob
import json
import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ISE, NAME_SERVER, ATIRMA = "", "", ""
LIMIT_S = 60
DAY_MS = 86_400_000
MORNING_MS = 1_700_000_000_000


class Failed(Exception):
    pass


class Skipped(Exception):
    pass


def expect(what, holds, found=""):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def until(holds, what, wait=30):
    """Repeats a question to another process until the answer is the expected one."""
    end = time.monotonic() + wait
    while not (found := holds()):
        if time.monotonic() > end:
            raise Failed(f"not within {wait} s: {what}")
        time.sleep(0.1)
    return found


def unprivileged():
    if os.geteuid() != 0:
        return {}
    for name in ("postgres", "nobody"):
        try:
            user = pwd.getpwnam(name)
            return {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
        except KeyError:
            continue
    raise Skipped("there is neither a user 'postgres' nor 'nobody' to run PostgreSQL as")


def programs():
    """The folder of the newest PostgreSQL."""
    found = sorted(glob.glob("/usr/lib/postgresql/*/bin/initdb"), key=lambda path: int(path.split("/")[4]))
    if not found or int(found[-1].split("/")[4]) < 15:
        raise Skipped("PostgreSQL 15 is not installed (cmake/install-packages test)")
    return Path(found[-1]).parent


def family(*roots):
    """These processes and all that they started, parents first."""
    children = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                children.setdefault(int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1]), []).append(int(entry.name))
            except (OSError, IndexError):
                continue
    made = [each for each in roots if each > 1]
    for each in made:
        made += [child for child in children.get(each, []) if child > 1 and child not in made]
    return made


def signalled(number, *roots):
    for pid in family(*roots):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass


class Server:
    """A PostgreSQL of its own."""

    def __init__(self, folder, data=None, password=None, options=(), port=5432):
        self.bin, self.who = programs(), unprivileged()
        self.folder = folder / "server"
        self.data = data or self.folder / "data"
        for each in (self.folder, self.data):
            each.mkdir(exist_ok=True)
        for each in (self.folder, self.data):
            if self.who:
                os.chown(each, self.who["user"], self.who["group"])
        folder.chmod(0o755)
        words = ["-D", self.data / "cluster", "-U", "atirma", "--data-checksums", "--no-sync"]
        if password:
            file = self.folder / "first-password"
            file.write_text(password + "\n")
            file.chmod(0o644)
            words += ["-A", "scram-sha-256", "--pwfile", file]
        else:
            words += ["-A", "trust"]
        self.environment = {"PATH": os.environ["PATH"], "LANG": "C", "PGPASSWORD": password or ""}
        done = self.command("initdb", *words)
        expect("initdb made a cluster", done.returncode == 0, done.stderr)
        self.process, self.options, self.port = None, options, str(port)
        self.start()
        done = self.command("createdb", "-h", self.folder, "-p", self.port, "-U", "atirma", "atirma")
        expect("there is a database", done.returncode == 0, done.stderr)
        self.url = f"postgresql://atirma@/atirma?host={self.folder}&port={self.port}"

    def command(self, name, *words):
        return subprocess.run([str(self.bin / name), *map(str, words)], env=self.environment, capture_output=True, text=True,
                              timeout=LIMIT_S, cwd="/", check=False, **self.who)

    def start(self):
        with (self.folder / "server.log").open("a") as log:
            self.process = subprocess.Popen(
                [str(self.bin / "postgres"), "-D", str(self.data / "cluster"), "-k", str(self.folder), "-p", self.port, "-c", "listen_addresses=",
                 "-c", "wal_keep_size=0", "-c", "max_wal_size=64MB", "-c", "min_wal_size=32MB", *self.options],
                env=self.environment, stdout=log, stderr=log, cwd="/", start_new_session=True, **self.who)
        until(lambda: self.command("pg_isready", "-h", self.folder, "-p", self.port).returncode == 0, "PostgreSQL accepts connections")

    def signal_all(self, number):
        signalled(number, self.process.pid)

    def kill(self):
        """As a loss of power of the server's processes."""
        self.signal_all(signal.SIGKILL)
        self.process.wait()

    def stop(self):
        if self.process and self.process.poll() is None:
            self.process.send_signal(signal.SIGQUIT)
            self.process.wait()

    def session(self):
        """A psql that reads what is written to it."""
        return subprocess.Popen([str(self.bin / "psql"), "-h", str(self.folder), "-p", self.port, "-U", "atirma", "-d", "atirma", "-Xq",
                                 "-v", "ON_ERROR_STOP=1"], env=self.environment, stdin=subprocess.PIPE, text=True, cwd="/", **self.who)

    def ask(self, sql, database="atirma"):
        done = self.command("psql", "-h", self.folder, "-p", self.port, "-U", "atirma", "-d", database, "-AtXq", "-v", "ON_ERROR_STOP=1", "-c", sql)
        expect(f"the server answers {sql}", done.returncode == 0, done.stderr)
        return done.stdout.strip()


class Shore:
    """A name server and nodes of boats."""

    def __init__(self, folder):
        self.folder, self.running, self.at = folder, [], ""
        names = self.start("names", NAME_SERVER, "--fresh", "--listen", "tcp://127.0.0.1:0")
        self.at = names.stdout.readline().split()[-1]

    def environment(self, **more):
        made = {name: value for name, value in os.environ.items() if not name.startswith(("ISE_", "PG"))}
        return made | {"HOME": str(self.folder), "ISE_NAME_SERVER": self.at} | more

    def start(self, name, *words, **variables):
        with (self.folder / f"{name}.log").open("a") as log:
            made = subprocess.Popen([str(word) for word in words], stdout=subprocess.PIPE, stderr=log, text=True, env=self.environment(**variables))
        self.running.append(made)
        return made

    def node(self, n, url, *words, wait=True, **variables):
        made = self.start(f"node-{n}", ATIRMA, "run", "communication-node", "--path", f"atirma/shore/node-{n}", "--store", url,
                          "--proxy", "gprs=atirma/shore/gprs", *words, **variables)
        if wait:
            until(lambda: self.call(n, "track", {}).returncode == 0, f"node {n} answers")
        return made

    def log(self, name):
        return (self.folder / f"{name}.log").read_text()

    def atirma(self, *words, **variables):
        return subprocess.run([str(word) for word in (ATIRMA, *words)], env=self.environment(**variables), capture_output=True, text=True,
                              timeout=LIMIT_S, check=False)

    def call(self, n, service, request, who="t/proxy"):
        return subprocess.run([ISE, "--as", who, "--timeout", "25s", "call", f"atirma/shore/node-{n}", service, json.dumps(request)],
                              env=self.environment(), capture_output=True, text=True, timeout=LIMIT_S, check=False)

    def asked(self, n, service, request, who="t/proxy"):
        done = self.call(n, service, request, who)
        expect(f"node {n} answers {service}", done.returncode == 0, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def keep(self, n, sequences, **more):
        return self.call(n, "telemetry_store", {"packets": [packet(each, **more) for each in sequences]})

    def kept(self, n, sequences, **more):
        done = self.keep(n, sequences, **more)
        expect(f"node {n} keeps {list(sequences)[:3]}…", done.returncode == 0, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def track(self, n, **request):
        made, seen = [], []
        while True:
            page = self.asked(n, "track", {"seen": seen, **request})
            made += [each["sequence"] for each in page["packets"]]
            seen = page["seen"]
            if not page["more"]:
                return made

    def next_of(self, path, service):
        """The next packet that it publishes."""
        done = subprocess.run([ISE, "--wait", "--timeout", "25s", "echo", path, service, "--count", "1"], env=self.environment(), capture_output=True, text=True,
                              timeout=LIMIT_S, check=False)
        expect(f"{path} publishes {service}", done.returncode == 0, done.stderr)
        return json.loads(done.stdout.strip().splitlines()[-1])

    def state(self, n):
        return self.next_of(f"atirma/shore/node-{n}", "communication_state")

    def close(self):
        for one in self.running:
            if one.poll() is None:
                one.kill()
            one.communicate()


def packet(sequence, boot=3, raw=None, at=None):
    measured = at if at is not None else MORNING_MS + sequence * 1000
    seconds = measured / 1000  # as JSON has times
    return {"link": "gprs", "boot": boot, "sequence": sequence, "measured_at": seconds, "received_at": seconds + 0.5,
            "raw": base64.b64encode(raw or bytes([1, 2, sequence % 256, sequence // 256 % 256])).decode()}


def migrated(shore, server):
    done = shore.atirma("store", "migrate", server.url)
    expect("the tables are made", done.returncode == 0 and "version" in done.stdout, done.stderr)


def refused(done, *words):
    text = done.stdout + done.stderr
    expect(f"it is refused with {words}", done.returncode != 0 and all(word in text for word in words), text)


def story_two_nodes(folder, shore):
    """Two nodes on one database keep each packet once, show it both, and agree on authority and telecommands."""
    server = Server(folder)
    try:
        migrated(shore, server)
        shore.node(1, server.url)
        shore.node(2, server.url)
        expect("three are new", shore.kept(1, [1, 2, 3])["fresh"] == 3)
        expect("one of two is new at the other node", shore.kept(2, [3, 4])["fresh"] == 1)
        expect("the same again is nothing new", shore.kept(1, [4, 4, 1])["fresh"] == 0)
        forged = shore.call(2, "telemetry_store", {"packets": [packet(2, raw=b"\x01\x02forged")]})
        expect("another content under the same number is kept beside it", json.loads(forged.stdout)["fresh"] == 1, forged.stderr)
        for n in (1, 2):
            until(lambda n=n: shore.track(n) == [1, 2, 3, 4, 2], f"node {n} has all, in the same order")
        expect("a window of time", shore.track(1, **{"from": MORNING_MS / 1000 + 2, "until": MORNING_MS / 1000 + 4}) == [2, 3, 2])
        page = shore.asked(1, "track", {"max_packets": 2})
        expect("a cursor of one node is one of the other", [each["sequence"] for each in shore.asked(2, "track", {"seen": page["seen"]})["packets"]] == [3, 4, 2])

        ana, bob = "atirma/operators/ana", "atirma/operators/bob"
        expect("ana takes the authority at node 1", shore.asked(1, "authority", {"action": "take"}, ana)["holder"] == ana)
        refused(shore.call(2, "authority", {"action": "take"}, bob), ana, "holds the authority")
        hold = {"command": {"kind": "set_mode", "mode": "hold"}}
        refused(shore.call(2, "telecommand", {"id": 7, **hold}, bob), ana, "holds the authority")
        expect("ana commands at node 2", shore.asked(2, "telecommand", {"id": 7, **hold}, ana)["id"] == 7)
        expect("the same again at node 1 is the same", shore.asked(1, "telecommand", {"id": 7, **hold}, ana)["id"] == 7)
        refused(shore.call(1, "telecommand", {"id": 7, "command": {"kind": "ping"}}, ana), "choose another id")
        taken = shore.asked(2, "authority", {"action": "take", "confirmed": True}, bob)
        # At once: node 1 has not looked yet, and the row's lock says that it is outdated.
        refused(shore.call(1, "telecommand", {"id": 8, **hold}, ana), bob, "holds the authority")
        looked = shore.asked(1, "authority", {"action": "look"}, ana)
        expect("both know the same epoch", looked["epoch"] == taken["epoch"], looked)
        for n in (1, 2):
            record = shore.asked(n, "telecommand_record", {})
            expect("one record for both", 7 in [each["id"] for each in record["entries"]] and record["authority"][0]["holder"] == bob, record)
    finally:
        server.stop()


def story_track_of_a_day(folder, shore):
    """The track of a day is looked for in the partition of its month only, however long the boat has sailed."""
    server = Server(folder)
    try:
        migrated(shore, server)
        shore.node(1, server.url)
        for month in range(6):
            packets = [packet(month * 100 + i, at=MORNING_MS + month * 31 * DAY_MS + i * 60_000) for i in range(100)]
            done = shore.call(1, "telemetry_store", {"packets": packets})
            expect("they are kept", done.returncode == 0 and json.loads(done.stdout)["fresh"] == 100, done.stderr)
        server.ask("ANALYZE atirma.packets")
        counted = "SELECT sum(n_tup_ins) FROM pg_stat_user_tables WHERE relname LIKE 'packets\\_%'"
        until(lambda: server.ask(counted) == "600", "the server counts them")
        server.ask("SELECT pg_stat_reset()")
        day = (MORNING_MS + 3 * 31 * DAY_MS) / 1000
        expect("the day's packets", shore.track(1, **{"from": day, "until": day + 86_400}) == list(range(300, 400)))
        scanned = "SELECT string_agg(relname, ',') FROM pg_stat_user_tables WHERE relname LIKE 'packets\\_%' AND seq_scan + idx_scan > 0"
        expect("only its month is looked at", until(lambda: server.ask(scanned), "the server counts it") == "packets_2024_02", server.ask(scanned))
    finally:
        server.stop()


def story_takes_over(folder, shore):
    """The open telecommands of a killed node go on at another one, and a node is refused a peer."""
    server = Server(folder)
    try:
        migrated(shore, server)
        first = shore.node(1, server.url)
        shore.node(2, server.url)
        shore.asked(1, "authority", {"action": "take"}, "atirma/operators/ana")
        command = {"id": 9, "command": {"kind": "set_mode", "mode": "hold"}, "valid_s": 600}
        shore.asked(1, "telecommand", command, "atirma/operators/ana")
        owner = lambda: server.ask("SELECT node FROM atirma.commands WHERE id = 9")
        expect("node 1 has it", owner() == "atirma/shore/node-1", owner())
        first.kill()
        first.wait()
        until(lambda: owner() == "atirma/shore/node-2", "node 2 took it over")
        done = shore.atirma("run", "communication-node", "--store", server.url, "--peer", "atirma/shore/node-1")
        refused(done, "share a store on PostgreSQL", "no peer")
    finally:
        server.stop()


def story_killed(folder, shore):
    """kill -9 of the server: nothing acknowledged is lost, packets are refused meanwhile, and all goes on by itself."""
    server = Server(folder)
    try:
        migrated(shore, server)
        shore.node(1, server.url)
        acknowledged = 0
        for round_ in range(3):
            for _ in range(5):
                shore.kept(1, range(acknowledged + 1, acknowledged + 21))
                acknowledged += 20
            server.kill()
            refused(shore.keep(1, [100_000]), "do not acknowledge it to the boat")
            state = until(lambda: (told := shore.state(1))["trouble"] and told, "the node reports that nothing can be kept")
            expect("it names the server", str(folder) in state["trouble"], state["trouble"])
            refused(shore.call(1, "telecommand", {"command": {"kind": "ping"}}, "atirma/operators/ana"), "cannot be recorded")
            (server.data / "cluster" / "postmaster.pid").unlink(missing_ok=True)
            server.start()
            until(lambda: not shore.state(1)["trouble"], "the node goes on by itself")
        until(lambda: sorted(each for each in shore.track(1) if each < 100_000) == list(range(1, acknowledged + 1)),
              "all that was acknowledged is there, once")
        # A server that answers nothing is one that is away.
        server.signal_all(signal.SIGSTOP)
        refused(shore.keep(1, [200_000]), "do not acknowledge")
        server.signal_all(signal.SIGCONT)
        until(lambda: not shore.state(1)["trouble"], "the node goes on after a server that hung")
        until(lambda: shore.keep(1, [200_000]).returncode == 0, "it keeps again")
        expect("once", server.ask("SELECT count(*) FROM atirma.packets WHERE sequence = 200000") == "1")
        checked = shore.atirma("store", "check", server.url)
        expect("the database is sound", checked.returncode == 0 and "is sound" in checked.stdout, checked.stdout + checked.stderr)
    finally:
        server.signal_all(signal.SIGCONT)
        server.stop()


def story_checked_in_use(folder, shore):
    """A check beside a node that stores sees the boat as of one moment: what comes meanwhile is no fault."""
    server = Server(folder)
    try:
        migrated(shore, server)
        shore.node(1, server.url)
        shore.kept(1, range(1, 21))
        storing = server.session()
        storing.stdin.write("BEGIN; LOCK TABLE atirma.packets;\n")
        storing.stdin.flush()
        until(lambda: server.ask("SELECT count(*) FROM pg_locks WHERE mode = 'AccessExclusiveLock' AND granted") != "0", "the table is locked")
        check = shore.start("check", ATIRMA, "store", "check", server.url)
        until(lambda: server.ask("SELECT count(*) FROM pg_locks WHERE NOT granted") != "0", "the check reads the packets")
        storing.stdin.write("""
            WITH given AS (UPDATE atirma.boats SET head = head + 1 RETURNING number, head)
            INSERT INTO atirma.packets SELECT boat, boot, sequence + 1, measured, given.head, received, link, kind, history, raw
            FROM atirma.packets, given WHERE position = given.head - 1; COMMIT;\n""")
        storing.stdin.close()
        expect("it is stored", storing.wait(30) == 0)
        said, _ = check.communicate(timeout=30)
        expect("the database is sound", check.returncode == 0 and "20 packets" in said, said)
        expect("the packet is there", server.ask("SELECT count(*), max(position) FROM atirma.packets") == "21|21")
    finally:
        server.stop()


def story_full(folder, shore):
    """A full file system under the tables: refused with the server's words, and it goes on when there is room."""
    room = folder / "room"
    room.mkdir()
    if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=120m", "ise-test", str(room)], check=False, capture_output=True).returncode != 0:
        raise Skipped("a small tmpfs cannot be mounted here")
    try:
        server = Server(folder, room)
        try:
            migrated(shore, server)
            shore.node(1, server.url)
            shore.kept(1, range(1, 11))
            ballast = room / "ballast"
            subprocess.run(["sh", "-c", f"dd if=/dev/zero of={ballast} bs=1M 2>/dev/null; dd if=/dev/zero of={ballast}2 bs=4k 2>/dev/null"], check=False)
            sequence, done = 1000, None
            for sequence in range(1000, 200_000, 60):
                done = shore.call(1, "telemetry_store", {"packets": [packet(each, raw=b"\x01\x02" + bytes(900)) for each in range(sequence, sequence + 60)]})
                if done.returncode != 0:
                    break
            refused(done, "do not acknowledge it to the boat")
            expect("the node reports it", "nothing can be kept" in shore.log("node-1"), shore.log("node-1"))
            told = done.stderr + (folder / "server" / "server.log").read_text()
            expect("for want of room", "No space left on device" in told or "could not extend" in told, told[-2000:])
            # Nothing waits to be kept, and it goes on to report: it tries with a write that needs room.
            log = folder / "server" / "server.log"
            until(lambda: log.read_text().count("SELECT atirma.probe()") >= 3 or server.process.poll() is not None, "the node tries")
            expect("the trouble stays", shore.state(1)["trouble"] and "takes packets again" not in shore.log("node-1"), shore.log("node-1"))
            ballast.unlink()
            Path(str(ballast) + "2").unlink(missing_ok=True)
            if server.process.poll() is not None:  # its log could not be extended: it ends, and an administrator starts it
                (server.data / "cluster" / "postmaster.pid").unlink(missing_ok=True)
                server.start()
            until(lambda: not shore.state(1)["trouble"], "the node goes on by itself", 60)
            shore.kept(1, range(sequence, sequence + 60), raw=b"\x01\x02" + bytes(900))
            expect("what was acknowledged before is there", shore.track(1)[:10] == list(range(1, 11)))
        finally:
            server.stop()
    finally:
        subprocess.run(["umount", "-l", str(room)], check=False)


def story_round_trip(folder, shore):
    """A file goes to a database and back, twice, without a difference; retention is per kind and boat."""
    server = Server(folder)
    try:
        done = shore.atirma("store", "import", folder / "none.db", server.url)
        refused(done, "none.db")
        file, back = folder / "node.db", folder / "back.db"
        node = shore.start("node-1", ATIRMA, "run", "communication-node", "--path", "atirma/shore/node-1", "--file", file, "--proxy", "gprs=atirma/shore/gprs")
        until(lambda: shore.call(1, "track", {}).returncode == 0, "the node answers")
        for first in range(1, 2001, 250):
            shore.kept(1, range(first, first + 250))
        shore.call(1, "telemetry_store", {"packets": [packet(5, raw=b"\x01\x02other"), packet(6, at=-5), packet(7, boot=9, at=4_000_000_000_000_000)]})
        shore.asked(1, "authority", {"action": "take"}, "atirma/operators/ana")
        shore.asked(1, "telecommand", {"id": 7, "command": {"kind": "set_mode", "mode": "hold"}}, "atirma/operators/ana")
        before, epoch = shore.track(1), shore.asked(1, "authority", {})["epoch"]
        node.terminate()
        node.wait()
        refused(shore.atirma("store", "import", file, server.url), "atirma store migrate")
        migrated(shore, server)
        done = shore.atirma("store", "import", file, server.url)
        expect("all of it is new", done.returncode == 0 and "2003 of the packets were new" in done.stdout, done.stdout + done.stderr)
        done = shore.atirma("store", "import", file, server.url)
        expect("and nothing the second time", done.returncode == 0 and " 0 of the packets were new" in done.stdout, done.stdout + done.stderr)
        node = shore.node(1, server.url)
        expect("the track is the same", shore.track(1) == before)
        expect("the authority too", shore.asked(1, "authority", {})["epoch"] == epoch)
        expect("and the telecommand", 7 in [each["id"] for each in shore.asked(1, "telecommand_record", {})["entries"]])
        apart = server.ask("SELECT count(*) FROM atirma.packets_other")
        expect("a wrong clock fills no month", apart == "2", apart)
        node.terminate()
        node.wait()
        refused(shore.atirma("store", "export", server.url, back, "--boat", "boat-2"), "no boat boat-2")
        done = shore.atirma("store", "export", server.url, back)
        expect("it is exported", done.returncode == 0, done.stderr)
        shore.start("node-2", ATIRMA, "run", "communication-node", "--path", "atirma/shore/node-2", "--file", back, "--proxy", "gprs=atirma/shore/gprs")
        until(lambda: shore.call(2, "track", {}).returncode == 0, "a node runs on the exported file")
        expect("the track is the same again", shore.track(2) == before)
        expect("the file is sound", shore.atirma("store", "check", back).returncode == 0)

        shore.kept(2, [])
        done = shore.atirma("store", "retain", server.url, "--boat", "atirma", "--kind", 2, "--days", 30)
        expect("a rule is set", "atirma, kind 2: 30 days" in done.stdout, done.stdout + done.stderr)
        server.ask("SELECT atirma.prune(1, 100)")
        left = server.ask("SELECT count(*) FROM atirma.packets")
        expect("what is older has gone, but for what a clock puts into the future", left == "1", left)
    finally:
        server.stop()


def story_refusals(folder, shore):
    """Passwords, versions and URLs: each wrong one has its own words, and a right one later is enough."""
    server = Server(folder, password="s3cret-of-the-sea")
    try:
        with_password = server.url.replace("atirma@", "atirma:s3cret-of-the-sea@")
        for done in (shore.atirma("store", "migrate", with_password), shore.atirma("run", "communication-node", "--store", with_password)):
            refused(done, "holds a password", "PGPASSFILE")
            expect("the password is not repeated", "s3cret" not in done.stdout + done.stderr, done.stderr)
        refused(shore.atirma("store", "migrate", server.url, PGPASSWORD="wrong"), "password authentication failed")
        refused(shore.atirma("run", "communication-node", "--store", "mysql://a/b"), "postgresql://")
        passwords = folder / "pgpass"
        passwords.write_text("*:*:*:*:wrong\n")
        passwords.chmod(0o600)
        shore.node(1, server.url, wait=False, PGPASSFILE=str(passwords))
        until(lambda: "password authentication failed" in shore.log("node-1"), "the node says why")
        passwords.write_text("*:*:*:*:s3cret-of-the-sea\n")
        until(lambda: "atirma store migrate" in shore.log("node-1"), "then that the tables are missing")
        done = shore.atirma("store", "migrate", server.url, PGPASSFILE=str(passwords))
        expect("migrated with the file", done.returncode == 0, done.stderr)
        until(lambda: shore.call(1, "track", {}).returncode == 0, "and goes on by itself")
        shore.kept(1, [1])
        words = Path(f"/proc/{shore.running[-1].pid}/cmdline").read_bytes()
        expect("no password in ps", b"s3cret" not in words)
        server.ask("UPDATE atirma.meta SET version = 999")
        refused(shore.atirma("store", "check", server.url, PGPASSFILE=str(passwords)), "version 999", "newer program")
        refused(shore.atirma("store", "migrate", server.url, PGPASSFILE=str(passwords)), "version 999", "newer program")
        refused(shore.atirma("run", "communication-node", "--path", "atirma/shore/node-3", "--store", server.url, PGPASSFILE=str(passwords)), "newer program")
        shore.kept(1, [2])  # one that runs goes on
    finally:
        server.stop()


def story_tls(folder, shore):
    """sslmode=verify-full: a server whose certificate is of another CA or for another host gets no packet."""
    if not shutil.which("openssl"):
        raise Skipped("openssl is not installed")
    keys = folder / "keys"
    keys.mkdir()

    def openssl(*words):
        done = subprocess.run(["openssl", *map(str, words)], capture_output=True, text=True, timeout=LIMIT_S, check=False)
        expect(f"openssl {words[0]} works", done.returncode == 0, done.stderr)

    for name in ("ca", "other-ca"):
        openssl("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", f"/CN={name}", "-days", 2, "-keyout", keys / f"{name}.key", "-out", keys / f"{name}.pem")
    openssl("req", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-keyout", keys / "server.key", "-out", keys / "server.csr")
    (keys / "names").write_text("subjectAltName=DNS:localhost\n")
    openssl("x509", "-req", "-in", keys / "server.csr", "-CA", keys / "ca.pem", "-CAkey", keys / "ca.key", "-CAcreateserial", "-days", 2,
            "-extfile", keys / "names", "-out", keys / "server.pem")
    who = unprivileged()
    if who:
        os.chown(keys / "server.key", who["user"], who["group"])
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = Server(folder, options=["-c", "listen_addresses=127.0.0.1", "-c", f"ssl_cert_file={keys / 'server.pem'}",
                                     "-c", f"ssl_key_file={keys / 'server.key'}", "-c", "ssl=on"], port=port)
    try:
        def url(host, ca):
            return f"postgresql://atirma@{host}:{port}/atirma?sslmode=verify-full&sslrootcert={keys / ca}"

        refused(shore.atirma("store", "migrate", url("localhost", "other-ca.pem")), "certificate verify failed")
        refused(shore.atirma("store", "migrate", url("127.0.0.1", "ca.pem")), "does not match host name")
        done = shore.atirma("store", "migrate", url("localhost", "ca.pem"))
        expect("the tables are made over TLS", done.returncode == 0, done.stderr)
        shore.node(2, url("localhost", "other-ca.pem"), wait=False)
        until(lambda: "certificate verify failed" in shore.log("node-2"), "a node that trusts another CA says why it does not connect")
        shore.node(3, url("127.0.0.1", "ca.pem"), wait=False)
        until(lambda: "does not match host name" in shore.log("node-3"), "so does one for which the server has another name")
        shore.node(1, url("localhost", "ca.pem"))
        shore.kept(1, [1, 2])
        plain = server.ask("SELECT count(*) FROM pg_stat_activity a JOIN pg_stat_ssl s USING (pid) WHERE client_port > 0 AND NOT ssl")
        ciphered = server.ask("SELECT count(*) FROM pg_stat_activity a JOIN pg_stat_ssl s USING (pid) WHERE client_port > 0 AND ssl")
        expect("all connections over TCP are over TLS", plain == "0" and int(ciphered) >= 1, f"{plain} {ciphered}")
    finally:
        server.stop()


def story_durable(folder, shore):
    """A node that cannot make sure that commits are synchronous does not use the connection."""
    server = Server(folder)
    try:
        migrated(shore, server)
        server.ask("CREATE ROLE sailor LOGIN; GRANT USAGE ON SCHEMA atirma TO sailor; GRANT ALL ON ALL TABLES IN SCHEMA atirma TO sailor;"
                   "REVOKE EXECUTE ON FUNCTION set_config(text, text, boolean) FROM PUBLIC")
        shore.node(1, server.url.replace("atirma@", "sailor@"), wait=False)
        until(lambda: "permission denied for function set_config" in shore.log("node-1"), "the node says why")
        expect("its store is not open", "its store cannot be opened" in shore.log("node-1"), shore.log("node-1"))
        expect("and it serves nothing", shore.call(1, "track", {}).returncode != 0)
        server.ask("GRANT EXECUTE ON FUNCTION set_config(text, text, boolean) TO sailor; ALTER ROLE sailor SET synchronous_commit = off")
        until(lambda: shore.call(1, "track", {}).returncode == 0, "it goes on when it may")
    finally:
        server.stop()


def story_set_back(folder, shore):
    """Another timeline of the server is another life: cursors stay valid for what both have in common."""
    server = Server(folder)
    try:
        migrated(shore, server)
        shore.node(1, server.url)
        shore.kept(1, [1, 2, 3])
        page = until(lambda: len((made := shore.asked(1, "track", {}))["packets"]) == 3 and made, "the packets are shown")
        life = shore.state(1)["store"]
        # As after a restored backup: the last packet is gone, and the timeline is another one.
        server.ask("DELETE FROM atirma.packets WHERE sequence = 3; UPDATE atirma.boats SET head = 2")
        server.stop()
        (server.data / "cluster" / "postmaster.pid").unlink(missing_ok=True)
        (server.data / "cluster" / "standby.signal").touch()
        if server.who:
            os.chown(server.data / "cluster" / "standby.signal", server.who["user"], server.who["group"])
        server.start()
        done = server.command("pg_ctl", "-D", server.data / "cluster", "promote", "-w")
        expect("the server was promoted", done.returncode == 0, done.stderr)
        until(lambda: shore.state(1)["store"] != life, "the node notices another life")
        until(lambda: shore.keep(1, [4]).returncode == 0, "and keeps packets")
        again = until(lambda: (made := shore.asked(1, "track", {"seen": page["seen"]}))["packets"] and made, "the new one is shown")
        expect("a follower misses nothing", [each["sequence"] for each in again["packets"]] == [4], again)
    finally:
        server.stop()


def stories_in(module):
    return {name.removeprefix("story_"): what for name, what in list(module.items()) if name.startswith("story_")}


def main(stories):
    global ISE, NAME_SERVER, ATIRMA
    if len(sys.argv) < 4:
        print(__doc__, file=sys.stderr)
        return 2
    ISE, NAME_SERVER, ATIRMA = sys.argv[1:4]
    probe = subprocess.run([ATIRMA, "store", "check", "postgresql://"], capture_output=True, text=True, check=False, env={"PGCONNECT_TIMEOUT": "1"})
    if "built without it" in probe.stderr:
        print("skipped: the programs were built without libpq (cmake/install-packages build)")
        return 77
    told, skipped = 0, []
    for name in sys.argv[4:] or stories:
        folder = Path(tempfile.mkdtemp(prefix="ise-postgres-"))
        shore = None
        try:
            shore = Shore(folder)
            stories[name](folder, shore)
            print(f"good: {name}", flush=True)
            told += 1
        except Skipped as why:
            skipped.append(str(why))
            print(f"skipped: {name}: {why}", flush=True)
        except (Failed, subprocess.TimeoutExpired) as why:
            print(f"wrong: {name}: {stories[name].__doc__}\n{why}", flush=True)
            for log in sorted(folder.rglob("*.log")):
                print(f"--- {log.name}\n{log.read_text()[-3000:]}", flush=True)
            return 1
        finally:
            if shore:
                shore.close()
            shutil.rmtree(folder, ignore_errors=True)
    return 0 if told else 77


if __name__ == "__main__":
    sys.exit(main(stories_in(globals())))
