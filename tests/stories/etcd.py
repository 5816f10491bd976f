"""A cluster of three etcd of a story, name servers over it, and the history of what was granted in it."""
import base64
import http.client
import json
import shutil
import ssl
import subprocess
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import grants
from world import Failed, Skipped, World

PREFIX = "/ise/names/name/"


def coded(text: str | bytes) -> str:
    return base64.b64encode(text.encode() if isinstance(text, str) else text).decode()


class Authority:
    """Signs certificates for 127.0.0.1 in the story's folder; each is a folder with ca.pem, certificate.pem and key.pem."""

    def __init__(self, world: World, name: str):
        self.world, self.name, self.folder = world, name, world.folder / name
        self.folder.mkdir()
        self.keys("ca", name)

    def keys(self, *words: str):
        subprocess.run([str(self.world.bin / "ise"), "keys", *words], cwd=self.folder, check=True, capture_output=True)

    def issue(self, name: str) -> Path:
        self.keys("request", f"ise://{self.name}/{name}", "--host", "127.0.0.1")
        self.keys("issue", name)
        return self.folder / name

    def issue_nameless(self, name: str) -> Path:
        """Without a common name: a gateway of an etcd with authentication refuses others."""
        made = self.folder / name
        made.mkdir()
        new_key = ["req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-keyout", made / "key.pem"]
        ca = ["-CA", self.folder / "authority/ca.pem", "-CAkey", self.folder / "authority/ca-key.pem"]
        for words in ([*new_key, "-subj", "/O=ise", "-out", made / "request.pem"],
                      ["x509", "-req", "-in", made / "request.pem", *ca, "-days", "2", "-out", made / "certificate.pem"]):
            subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)
        shutil.copy(self.folder / "authority/ca.pem", made)
        return made


class Cluster:
    """Three members on ports that were free, of loopback or of these hosts. With an authority they serve TLS, to clients
    with one of its certificates only."""

    def __init__(self, world: World, *options: str, authority: Authority | None = None, hosts: tuple[str | None, ...] = (None,) * 3):
        if not (program := shutil.which("etcd")):
            raise Skipped("there is no etcd here (Debian: etcd-server)")
        self.world, self.hosts = world, hosts
        self.addresses = [world.addresses[host] if host else "127.0.0.1" for host in hosts]
        ports = [(address, world.free_port(), world.free_port()) for address in self.addresses]
        self.names = [f"etcd{n}" for n in range(3)]
        self.urls = [f"http{'s' if authority else ''}://{address}:{client}" for address, client, _ in ports]
        self.tls = None
        if authority:
            mine = authority.issue("etcd")
            options += ("--client-cert-auth", "--trusted-ca-file", str(mine / "ca.pem"), "--cert-file", str(mine / "certificate.pem"),
                        "--key-file", str(mine / "key.pem"))
            self.tls = ssl.create_default_context(cafile=mine / "ca.pem")
            self.tls.load_cert_chain(mine / "certificate.pem", mine / "key.pem")
        self.store = f"etcd{'s' if authority else ''}://" + ",".join(f"{address}:{client}" for address, client, _ in ports)
        peers = [f"http://{address}:{peer}" for address, _, peer in ports]
        initial = ",".join(f"{name}={peer}" for name, peer in zip(self.names, peers))
        for name, url, peer, host in zip(self.names, self.urls, peers, hosts):
            world.run(name, [program, "--name", name, "--data-dir", str(world.folder / name), "--listen-client-urls", url,
                             "--advertise-client-urls", url, "--listen-peer-urls", peer, "--initial-advertise-peer-urls", peer,
                             "--initial-cluster", initial, "--initial-cluster-token", str(world.folder), *options], host)
        if not world.until(lambda: self.leader() is not None, 30):
            raise Failed("etcd elects no leader: " + (world.folder / "etcd0.err").read_text()[-2000:])

    def open(self, member: int, target: str, request: dict, wait: float):
        question = urllib.request.Request(f"{self.urls[member]}/v3/{target}", json.dumps(request).encode(), method="POST")
        with self.world.on(self.hosts[member]):
            return urllib.request.urlopen(question, timeout=wait, context=self.tls)

    def ask(self, member: int, target: str, request: dict, wait: float = 2) -> dict | None:
        try:
            with self.open(member, target, request, wait) as answer:
                return json.loads(answer.read())
        except (OSError, ValueError):
            return None

    def first(self, target: str, request: dict) -> dict:
        """The first answer of a member."""
        return next((found for member in range(3) if (found := self.ask(member, target, request))), {})

    def leader(self) -> int | None:
        for member in range(3):
            status = self.ask(member, "maintenance/status", {}, 1)
            if status and status.get("leader", "0") == status["header"]["member_id"]:
                return member
        return None

    def revokes_wrongly(self) -> bool:
        """Whether a leader that stood still for longer than a lease may end leases that were renewed meanwhile at its successor
        (etcd issue 15247, mended in 3.4.31 and 3.5.13)."""
        major, minor, patch = (int(part) for part in self.first("maintenance/status", {})["version"].split(".")[:3])
        return (major, minor, patch) < (3, 4, 31) or (3, 5, 0) <= (major, minor, patch) < (3, 5, 13)

    def demand_password(self, user: str, password: str):
        """That user may read and write what is below /ise/names/, and nothing else; then everybody needs a user."""
        below = {"permType": "READWRITE", "key": coded("/ise/names/"), "range_end": coded("/ise/names0")}
        for target, request in (
            ("auth/user/add", {"name": "root", "password": "pass-of-root"}),
            ("auth/role/add", {"name": "root"}),
            ("auth/user/grant", {"user": "root", "role": "root"}),
            ("auth/role/add", {"name": "names"}),
            ("auth/role/grant", {"name": "names", "perm": below}),
            ("auth/user/add", {"name": user, "password": password}),
            ("auth/user/grant", {"user": user, "role": "names"}),
            ("auth/enable", {}),
        ):
            if self.ask(0, target, request, 10) is None:
                raise Failed(f"etcd refuses {target}")
        if not self.world.until(lambda: self.ask(1, "kv/range", {"key": coded("/ise/names/offset")}) is None, 10):
            raise Failed("etcd answers without a user")

    def process(self, member: int):
        return self.world.processes[self.names[member]]


class History:
    """Writes all grants that the store has had into the story's history, which grants.py judges."""

    def __init__(self, cluster: Cluster):
        self.cluster, self.over, self.next, self.offset = cluster, False, 1, 0
        self.held: dict[str, int] = {}  # epochs of what is granted now
        self.file = cluster.world.folder / "store.grants.jsonl"
        self.thread = threading.Thread(target=self.follow, daemon=True)
        self.thread.start()

    def follow(self):
        member = 0
        while not self.over:
            request = {"create_request": {"key": coded(PREFIX), "range_end": coded(PREFIX[:-1] + "0"), "start_revision": str(self.next)}}
            try:
                with self.cluster.open(member, "watch", request, 3) as answer:
                    for line in answer:
                        self.take(json.loads(line).get("result", {}))
            except (OSError, ValueError, http.client.HTTPException):
                time.sleep(0.1)
            member = (member + 1) % 3

    def take(self, told: dict):
        self.next = max(self.next, int(told.get("compact_revision", 0)))
        for event in told.get("events", []):
            entry = event["kv"]
            self.next = max(self.next, int(entry["mod_revision"]) + 1)
            path = base64.b64decode(entry["key"]).decode().removeprefix(PREFIX)
            if event.get("type") == "DELETE":
                self.write("ended", path, epoch=self.held.pop(path, 0))
                continue
            self.held[path] = self.epoch(entry)
            claim = json.loads(base64.b64decode(entry["value"]))["claim"]
            self.write("granted", path, epoch=self.held[path], holder=int(claim["incarnation"]))

    def epoch(self, entry: dict) -> int:
        while not self.offset:  # it is there before any name
            found = self.cluster.first("kv/range", {"key": coded("/ise/names/offset")}).get("kvs")
            self.offset = int(base64.b64decode(found[0]["value"])) if found else 0
        return self.offset + int(entry["create_revision"])

    def write(self, what: str, path: str, **more):
        with self.file.open("a") as file:
            file.write(json.dumps({"at": time.monotonic_ns(), "what": what, "path": path} | more) + "\n")

    def complete(self) -> bool:
        """Whether everything is written that the store has now."""
        there = self.cluster.first("kv/range", {"key": coded(PREFIX), "range_end": coded(PREFIX[:-1] + "0")}).get("kvs", [])
        return self.held == {base64.b64decode(one["key"]).decode().removeprefix(PREFIX): self.epoch(one) for one in there}

    def wrong(self, **bounds) -> list[str]:
        """Ends the history. The bounds are those of grants.py."""
        found = [] if self.cluster.world.until(self.complete, 10) else ["the history of grants is not complete"]
        self.cluster.world.note("end")
        self.over = True
        return found + grants.check(grants.read(self.cluster.world.folder), grants.Bounds(**bounds))


class NameServers:
    """Three of them over one cluster; `names` is the list for clients."""

    def __init__(self, world: World, cluster: Cluster, *options: str, **variables: str):
        self.world, self.hosts, found = world, cluster.hosts, []
        for n in range(3):
            listen = f"tcp://{cluster.addresses[n]}:{world.free_port()}"
            made = world.run(f"names{n}", ["ise_name_server", "--listen", listen, "--log-level", "warning", "--store", cluster.store, *options], cluster.hosts[n],
                             **variables)
            made.line("tcp://")
            found.append(listen)
        self.each, self.names = found, ",".join(found)
        world.names = self.names

    def listed(self, server: int) -> dict[str, int]:
        ran = self.world.ise("--json", "list", wait=5, host=self.hosts[server], ISE_NAME_SERVER=self.each[server])
        return {one["path"]: int(one["epoch"]) for one in json.loads(ran.stdout or "[]")} if ran.returncode == 0 else {}

    def all_list(self, paths: dict[str, int], wait: float = 20):
        return self.world.until(lambda: all({p: e for p, e in self.listed(n).items() if p in paths} == paths for n in range(3)), wait)
