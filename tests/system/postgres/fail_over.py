#!/usr/bin/env python3
"""A boat and its communication node while Patroni fails over between three real PostgreSQL servers, which are killed and stopped.

usage: fail_over.py ISE NAME_SERVER ATIRMA
Patroni has the configuration of docs/postgresql.md, with other addresses, folders and passwords. Exit code 77: Patroni, etcd,
PostgreSQL 15 or newer, or libpq in the build, is missing.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import stories
from stories import LIMIT_S, Skipped, expect, programs, refused, signalled, unprivileged, until

PAGE = Path(__file__).resolve().parents[3] / "docs/postgresql.md"
WITHIN_S = 30  # as the page promises
ANA = "atirma/operators/ana"


def free_ports(count):
    probes = [socket.socket() for _ in range(count)]
    for each in probes:
        each.bind(("127.0.0.1", 0))
    made = [each.getsockname()[1] for each in probes]
    for each in probes:
        each.close()
    return made


class Member:
    """One of the three hosts: PostgreSQL under its Patroni."""

    def __init__(self, cluster, number, port, api):
        self.cluster, self.name, self.port, self.api = cluster, f"db-{number}", port, api
        self.data = cluster.folder / self.name
        self.file = cluster.folder / f"{self.name}.yml"
        self.file.write_text(cluster.configuration(self))
        self.process = None

    def start(self):
        with (self.cluster.folder / f"{self.name}.log").open("a") as log:
            self.process = subprocess.Popen([self.cluster.patroni, str(self.file)], stdout=log, stderr=log, cwd="/", start_new_session=True,
                                            env={"PATH": os.environ["PATH"], "LANG": "C.UTF-8", "HOME": str(self.cluster.folder)}, **self.cluster.who)

    def postmaster(self):
        try:
            return int((self.data / "postmaster.pid").read_text().split()[0])
        except (OSError, IndexError):
            return 0

    def signal(self, number):
        """To Patroni, PostgreSQL and all their processes."""
        signalled(number, self.process.pid, self.postmaster())

    def kill(self):
        self.signal(signal.SIGKILL)
        self.process.wait()

    def told(self, what):
        """What its Patroni answers, with the status of HTTP; nothing where it does not."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.api}/{what}", timeout=2) as answer:
                return json.loads(answer.read())
        except (OSError, ValueError):
            return None

    def ask(self, sql, database="atirma", wait=True):
        """The answer; without `wait`, the client that asks."""
        words = [str(self.cluster.bin / "psql"), "-h", "127.0.0.1", "-p", str(self.port), "-U", "postgres", "-d", database, "-AtXq", "-v",
                 "ON_ERROR_STOP=1", "-c", sql]
        asked = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.cluster.environment)
        if not wait:
            return asked
        said, wrong = asked.communicate(timeout=LIMIT_S)
        expect(f"{self.name} answers {sql}", asked.returncode == 0, wrong)
        return said.strip()


class Cluster:
    """An etcd and three members."""

    def __init__(self, folder):
        self.patroni, etcd = shutil.which("patroni"), shutil.which("etcd")
        if not self.patroni or not etcd:
            raise Skipped(f"{'etcd' if self.patroni else 'Patroni'} is not installed (cmake/install-packages test)")
        self.bin, self.who, self.folder = programs(), unprivileged(), folder / "cluster"
        said = subprocess.run([self.patroni, "--version"], capture_output=True, text=True, timeout=LIMIT_S, check=False).stdout
        self.version = tuple(int(each) for each in re.findall(r"\d+", said)[:2])
        self.folder.mkdir()
        folder.chmod(0o755)
        if self.who:
            os.chown(self.folder, self.who["user"], self.who["group"])
        client, peer, *ports = free_ports(8)
        self.etcd_at = f"127.0.0.1:{client}"
        with (folder / "etcd.log").open("w") as log:
            self.etcd = subprocess.Popen([etcd, "--data-dir", str(folder / "etcd"), "--listen-client-urls", f"http://{self.etcd_at}",
                                          "--advertise-client-urls", f"http://{self.etcd_at}", "--listen-peer-urls", f"http://127.0.0.1:{peer}",
                                          "--initial-advertise-peer-urls", f"http://127.0.0.1:{peer}",
                                          "--initial-cluster", f"default=http://127.0.0.1:{peer}"], stdout=log, stderr=log)
        self.environment = {"PATH": os.environ["PATH"], "PGPASSWORD": "of-the-superuser", "PGCONNECT_TIMEOUT": "5"}
        self.members = []
        for number in range(3):
            self.members.append(Member(self, number + 1, ports[2 * number], ports[2 * number + 1]))
        self.passwords = folder / "pgpass"
        self.passwords.write_text("*:*:*:atirma:of-the-nodes\n")
        self.passwords.chmod(0o600)

    def url(self, *first):
        """Of the database at these servers, then the others."""
        order = [*first, *(each for each in self.members if each not in first)]
        return f"postgresql://atirma@{','.join(f'127.0.0.1:{each.port}' for each in order)}/atirma"

    def configuration(self, of):
        """The page's, for this member."""
        found = re.search(r"```yaml\n(scope: .*?)```", PAGE.read_text(), re.S)
        expect("the page has the configuration", found, PAGE)
        made = found[1]
        for there, here in (("name: db-1", f"name: {of.name}"), ("10.0.0.1:8008", f"127.0.0.1:{of.api}"), ("10.0.0.1:5432", f"127.0.0.1:{of.port}"),
                            ("[10.0.0.1:2379, 10.0.0.2:2379, 10.0.0.3:2379]", f"[{self.etcd_at}]"), ("10.0.0.0/24", "127.0.0.1/32"),
                            ("/var/lib/postgresql/15/atirma", of.data), ("/usr/lib/postgresql/15/bin", self.bin),
                            ("/var/lib/postgresql/patroni.pgpass", f"{of.data}.pgpass"), ("/var/run/postgresql", self.folder),
                            ("FIRST-PASSWORD", "of-the-superuser"), ("SECOND-PASSWORD", "of-the-standbys")):
            expect(f"the page's configuration has '{there}'", there in made, made)
            made = made.replace(there, str(here))
        return made

    def start(self):
        self.members[0].start()
        until(lambda: self.members[0].told("primary"), "the first server is the primary", LIMIT_S)
        for each in self.members[1:]:
            each.start()
        self.members[0].ask("CREATE ROLE atirma LOGIN PASSWORD 'of-the-nodes'", "postgres")
        self.members[0].ask("CREATE DATABASE atirma OWNER atirma", "postgres")
        self.whole()

    def in_role(self, role):
        """The member that answers so to a load balancer's question: what it knows may be some seconds old."""
        return until(lambda: next((each for each in self.members if each.told(role)), None), f"a server is {role}")

    def whole(self):
        """Waits until all three stream, and one of the standbys is synchronous."""
        def is_whole():
            told = next((made for each in self.members if (made := each.told("cluster"))), {"members": []})
            roles = sorted(each["role"] for each in told["members"] if each["state"] in ("running", "streaming"))
            return roles == ["leader", "replica", "sync_standby"]

        until(is_whole, "one primary, a synchronous standby and another one", 2 * LIMIT_S)

    def close(self):
        for each in self.members:
            if each.process:
                each.kill()
        self.etcd.kill()
        self.etcd.wait()


class Feeder(threading.Thread):
    """Hands packets to node 1, each five again until they are acknowledged, as a proxy does."""

    def __init__(self, shore):
        super().__init__(daemon=True)
        self.shore, self.acknowledged, self.begun, self.over = shore, 0, 0.0, threading.Event()
        self.start()

    def run(self):
        while not self.over.is_set():
            begun = time.monotonic()
            if self.shore.keep(1, range(self.acknowledged + 1, self.acknowledged + 6)).returncode == 0:
                self.acknowledged, self.begun = self.acknowledged + 5, begun
            self.over.wait(0.1)

    def resumed(self, since):
        """After how many seconds packets were acknowledged that were handed over after that moment."""
        until(lambda: self.begun > since, f"the node acknowledges packets again {WITHIN_S} s after the fault", since + WITHIN_S - time.monotonic())
        return time.monotonic() - since

    def end(self):
        self.over.set()
        self.join(LIMIT_S)
        expect("the last call has ended", not self.is_alive())


def commanded(shore, number, mode):
    return shore.call(1, "telecommand", {"id": number, "command": {"kind": "set_mode", "mode": mode}, "valid_s": 60}, ANA)


def story_fails_over(folder, shore):
    """The primary is killed, then a standby hangs, then a primary: the node goes on within 30 s, and what was acknowledged is there once."""
    cluster = Cluster(folder)
    feeder = None
    try:
        cluster.start()
        done = shore.atirma("store", "migrate", cluster.url(), PGPASSFILE=str(cluster.passwords))
        expect("the tables are made", done.returncode == 0, done.stderr)
        cluster.in_role("primary").ask("ALTER ROLE atirma SET synchronous_commit = local")  # which a node overrules
        shore.node(1, cluster.url(), PGPASSFILE=str(cluster.passwords))
        call = f"tcp://127.0.0.1:{free_ports(1)[0]}"
        shore.start("gprs", stories.ATIRMA, "run", "gprs-proxy", "--store", "atirma/communication", "--boat-listen", call)
        shore.start("boat", stories.ATIRMA, "run", "boat-simulator", "--serial", "", "--gprs", call, "--gprs-period", "1", "--speedup", "5", "--boot", "7")
        feeder = Feeder(shore)
        until(lambda: shore.next_of("atirma/boat", "ground_truth")["gprs_acknowledged"] > 10 and feeder.acknowledged > 50, "packets are acknowledged")
        shore.asked(1, "authority", {"action": "take"}, ANA)

        def refused_meanwhile(number):
            until(lambda: shore.state(1)["trouble"], "the node reports that nothing can be kept", 15)
            refused(commanded(shore, number, "hold"), "postgresql://atirma@")

        def goes_on(what, since, number, mode):
            print(f"{what}: packets are acknowledged {feeder.resumed(since):.1f} s later", flush=True)
            until(lambda: not shore.state(1)["trouble"], "no trouble is left", 10)
            had = shore.next_of("atirma/boat", "ground_truth")["gprs_acknowledged"]
            until(lambda: shore.next_of("atirma/boat", "ground_truth")["gprs_acknowledged"] > had + 5, "the boat's packets are acknowledged again")
            done = until(lambda: (told := commanded(shore, number, mode)).returncode == 0 and told, "a telecommand is accepted again", 10)
            expect("under its number", json.loads(done.stdout)["id"] == number, done.stdout)
            until(lambda: shore.next_of("atirma/boat", "ground_truth")["mode"] == mode, "the boat executes it")

        # kill -9 of all processes of the primary's host.
        first, began = cluster.in_role("primary"), time.monotonic()
        first.kill()
        refused_meanwhile(101)
        goes_on("the primary was killed", began, 1, "hold")
        second = cluster.in_role("primary")
        expect("another one is the primary", second is not first)
        first.start()
        cluster.whole()

        # The synchronous standby hangs: commits wait for it until it is replaced.
        standby, began = cluster.in_role("sync"), time.monotonic()
        standby.signal(signal.SIGSTOP)
        until(lambda: second.ask("SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'SyncRep' AND usename = 'atirma'") != "0",
              "commits wait for it", 15)
        goes_on("the standby hung", began, 2, "station_keep")
        expect("the primary is the same", cluster.in_role("primary") is second)
        standby.signal(signal.SIGCONT)
        cluster.whole()

        # All processes of the primary's host hang: connections are accepted by its kernel, and nobody answers.
        shore.node(2, cluster.url(second), PGPASSFILE=str(cluster.passwords))
        began = time.monotonic()
        second.signal(signal.SIGSTOP)
        until(lambda: shore.state(2)["trouble"], "a node for which it is the first server reports it, too", 15)
        refused_meanwhile(102)
        goes_on("the primary hung", began, 3, "hold")
        until(lambda: not shore.state(2)["trouble"], "the other node goes on", began + WITHIN_S - time.monotonic())
        expect("a packet of another life is not kept twice", shore.kept(2, [1])["fresh"] == 0)
        # PostgreSQL goes on without its Patroni and takes itself for the primary: it acknowledges no commit.
        signalled(signal.SIGCONT, second.postmaster())
        until(lambda: second.ask("SELECT pg_is_in_recovery()") == "f", "the old primary takes itself for the primary")
        forged = second.ask("INSERT INTO atirma.probe VALUES ('forged')", wait=False)
        until(lambda: second.ask("SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'SyncRep' AND query LIKE 'INSERT%forged%'") == "1"
              or forged.poll() is not None, "a commit waits for the standby that has left")
        expect("it is not acknowledged", forged.poll() is None, forged.communicate() if forged.poll() is not None else "")
        if cluster.version < (3, 1):  # it could take the lock back (docs/postgresql.md): the host is reset
            second.kill()
            second.start()
        second.signal(signal.SIGCONT)
        until(lambda: second.told("replica"), "the old primary becomes a standby", 2 * LIMIT_S)
        expect("nor is it then", forged.wait(LIMIT_S) != 0)

        feeder.end()
        primary = cluster.in_role("primary")
        kept = primary.ask("SELECT count(*), count(DISTINCT sequence), min(sequence), max(sequence) FROM atirma.packets WHERE boot = 3")
        there = feeder.acknowledged
        expect("enough was acknowledged to prove something", there > 100, there)
        expect("what was acknowledged is there, once", kept == f"{there}|{there}|1|{there}", f"{kept} of {there}")
        safe = shore.next_of("atirma/boat", "ground_truth")["gprs_acknowledged"]
        count, different = (int(each) for each in primary.ask("SELECT count(*), count(DISTINCT sequence) FROM atirma.packets WHERE boot = 7").split("|"))
        expect("so are the boat's packets", count == different >= safe, f"{count}, {different} different, of {safe}")
        entries = [each for each in shore.asked(1, "telecommand_record", {})["entries"] if each["asked_by"] == ANA]
        expect("the refused telecommands are not recorded, the others are done", [(each["id"], each["result"]) for each in entries] ==
               [(3, "done"), (2, "done"), (1, "done")], entries)
        expect("the old primary's commit has gone", primary.ask("SELECT count(*) FROM atirma.probe WHERE filling = 'forged'") == "0")
        checked = shore.atirma("store", "check", cluster.url(), PGPASSFILE=str(cluster.passwords))
        expect("the database is sound", checked.returncode == 0 and "is sound" in checked.stdout, checked.stdout + checked.stderr)
    finally:
        if feeder:
            feeder.over.set()
        cluster.close()


if __name__ == "__main__":
    sys.exit(stories.main(stories.stories_in(globals())))
