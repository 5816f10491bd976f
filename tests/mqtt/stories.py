#!/usr/bin/env python3
"""The MQTT bridge with mosquitto and its clients: what goes out, outages of both sides, calls that come twice, TLS,
passwords, and what is refused.

usage: stories.py PROGRAMS CREW [NODE]
With NODE only check_mqtt.mjs runs, which is MQTT.js, on the same system. Exit code 77: there is no mosquitto.
"""

import json
import os
import re
import select
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

LIMIT_S = 60
PROGRAMS, CREW, NODE, MOSQUITTO = Path(), Path(), None, None


class Failed(Exception):
    pass


def expect(what, holds, found=""):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def until(what, ask, limit=LIMIT_S):
    """Asks until the answer is true, and returns it."""
    end = time.monotonic() + limit
    while True:
        found = ask()
        if found:
            return found
        if time.monotonic() > end:
            raise Failed(f"not within {limit} s: {what}; found: {found}")
        time.sleep(0.05)


def environment(**more):
    made = {name: value for name, value in os.environ.items() if not name.startswith("ISE_")}
    made.update(more)
    return made


class Program:
    """Runs until it is ended; output and log go to a file."""

    def __init__(self, folder, name, words, **variables):
        self.log = folder / f"{name}.log"
        self.began = self.log.stat().st_size if self.log.exists() else 0
        with self.log.open("a") as log:
            self.process = subprocess.Popen([str(word) for word in words], cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, env=environment(**variables))

    def text(self):
        with self.log.open(errors="replace") as log:
            log.seek(self.began)
            return log.read()

    def says(self, pattern):
        def look():
            found = re.search(pattern, self.text())
            if not found and self.process.poll() is not None:
                raise Failed(f"it ended: {self.text()}")
            return found

        return until(f"{self.log.name} says {pattern}", look)

    def kill(self):
        if self.process.poll() is None and self.process.pid > 1:
            self.process.kill()
        self.process.wait(LIMIT_S)


class Relay:
    """Between bridge and broker; `cut` ends what is connected and refuses more."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.to = None
        self.open = threading.Event()
        self.pairs, self.lock = [], threading.Lock()
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            one, _ = self.listener.accept()
            if not self.open.is_set():
                one.close()
                continue
            try:
                other = socket.create_connection(("127.0.0.1", self.to))
            except OSError:
                one.close()
                continue
            with self.lock:
                self.pairs.append((one, other))
            threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    @staticmethod
    def carry(one, other):
        try:
            while True:
                ready, _, _ = select.select([one, other], [], [])
                for side in ready:
                    data = side.recv(65536)
                    if not data:
                        raise OSError
                    (other if side is one else one).sendall(data)
        except (OSError, ValueError):
            for side in (one, other):
                try:
                    side.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
                side.close()

    def cut(self):
        self.open.clear()
        with self.lock:
            pairs, self.pairs = self.pairs, []
        for pair in pairs:
            for side in pair:
                try:
                    side.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass

    def heal(self, port):
        self.to = port
        self.open.set()


class System:
    """A name server, a counter and a winch, a broker, and relay and bridge between them."""

    def __init__(self, folder, broker="", access=None):
        self.folder = folder
        self.programs = []
        self.variables = {}
        names = ["--fresh", "--listen", f"local://{folder}/names"] if access else ["--fresh", "--listen", "tcp://127.0.0.1:0"]
        if access:
            (folder / "access.toml").write_text(access)
            (folder / "access.toml").chmod(0o600)
            self.variables["ISE_ACCESS"] = str(folder / "access.toml")
        made = self.run("names", [PROGRAMS / "ise_name_server", *names])
        self.at = made.says(r"(?:tcp|local)://\S+").group(0)
        self.variables["ISE_NAME_SERVER"] = self.at
        for name in ("counter", "winch"):
            self.run(name, [CREW, "run", name])
        self.relay = Relay()
        self.settings = broker or "listener 0 127.0.0.1\nallow_anonymous true\n"
        self.port = None
        self.start_broker()
        self.relay.heal(self.port)

    def run(self, name, words):
        made = Program(self.folder, name, words, **self.variables)
        self.programs.append(made)
        return made

    def start_broker(self):
        # mosquitto cannot tell which port the system chose: one that was free is tried until it is.
        for _ in range(20):
            if self.port is None:
                with socket.create_server(("127.0.0.1", 0)) as free:
                    self.port = free.getsockname()[1]
            settings = self.folder / "mosquitto.conf"
            settings.write_text(self.settings.replace("listener 0", f"listener {self.port}") + "\n" + ("user root\n" if os.geteuid() == 0 else ""))
            self.broker = self.run("mosquitto", [MOSQUITTO, "-v", "-c", settings])
            until("mosquitto runs", lambda: "running" in self.broker.text() or self.broker.process.poll() is not None)
            if self.broker.process.poll() is None:
                return
            if "in use" not in self.broker.text():
                raise Failed(self.broker.text())
            self.port = None
        raise Failed("no free port")

    def start_bridge(self, *options, wait=True, scheme="mqtt"):
        self.bridge = self.run("bridge", [PROGRAMS / "ise_mqtt_bridge", "run", "mqtt-bridge", f"--broker={scheme}://127.0.0.1:{self.relay.port}", *options])
        if wait:
            self.bridge.says("ready: ")
            until("the bridge knows the crew", lambda: self.status()["topics"] >= 3)
        return self.bridge

    def ise(self, *words):
        done = subprocess.run([str(word) for word in (PROGRAMS / "ise", *words)], cwd=self.folder, capture_output=True, text=True, timeout=LIMIT_S, env=environment(**self.variables), check=False)
        return done.returncode, done.stdout, done.stderr

    def call(self, path, service, request="{}"):
        code, out, problem = self.ise("call", path, service, request, "--json")
        if code != 0:
            return {"error": problem + out}
        told = json.loads(out)
        return told.get("response", told)

    def status(self):
        return {"topics": 0, "connected": False, "queued": 0, "trouble": "", "refused": 0, "not_published": 0} | self.call("ise/mqtt", "status")

    def count_up(self, packets):
        answer = self.call("crew/counter", "count_up", json.dumps({"packets": packets}))
        expect("it counts", "last" in answer, answer)
        return answer["last"]

    def subscribe(self, topic, name, *words):
        made = self.run(name, ["mosquitto_sub", "-h", "127.0.0.1", "-p", self.port, "-V", "5", "-q", "1", "-i", f"{name}-{self.port}", "-t", topic, "-F", "%t|%r|%P|%p", *words])
        until(f"{name} is subscribed", lambda: re.search(rf"Sending SUBACK to {name}-{self.port}", self.broker.text()))
        return Messages(made)

    def publish(self, topic, payload, *words):
        done = subprocess.run([str(word) for word in ("mosquitto_pub", "-h", "127.0.0.1", "-p", self.port, "-V", "5", "-q", "1", "-t", topic, "-m", payload, *words)], capture_output=True, text=True, timeout=LIMIT_S, check=False)
        return done.stdout + done.stderr

    def ask(self, service, request, correlation, answers="answers/me"):
        self.publish(f"ise/call/{service}", request, "-D", "publish", "response-topic", answers, "-D", "publish", "correlation-data", correlation)

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        for one in reversed(self.programs):
            one.kill()
        if kind:
            for one in ("bridge", "mosquitto", "winch"):
                file = self.folder / f"{one}.log"
                if file.exists():
                    sys.stderr.write(f"--- {one}\n" + "\n".join(file.read_text(errors="replace").splitlines()[-40:]) + "\n")


class Messages:
    """What a subscriber got: topic, retained, properties, payload."""

    def __init__(self, program):
        self.program = program

    def all(self):
        made = []
        for line in self.program.text().splitlines():
            parts = line.split("|", 3)
            if len(parts) == 4:
                properties = dict(re.findall(r"(\w+):(\S+)", parts[2]))
                made.append((parts[0], parts[1] == "1", properties, parts[3]))
        return made

    def wait(self, count):
        try:
            return until(f"{count} messages", lambda: self.all() if len(self.all()) >= count else None)
        except Failed as problem:
            raise Failed(f"{problem}\n{len(self.all())}:\n" + self.program.text()[-2000:]) from None


def what_goes_out(folder):
    with System(folder) as here:
        here.start_bridge("--queue=marks")
        each = here.subscribe("ise/out/crew/counter/marks", "each")
        here.count_up(3)
        got = each.wait(3)
        expect("every packet comes, as JSON", [json.loads(one[3])["n"] for one in got] == [1, 2, 3], got)
        expect("with its time and number", all("published" in one[2] and "number" in one[2] and "history" not in one[2] for one in got), got)
        late = here.subscribe("ise/out/crew/counter/state", "late").wait(1)
        expect("the latest state is retained", late[0][1] and json.loads(late[0][3])["n"] == 3, late)
        status = here.subscribe("ise/status", "status")
        expect("the bridge is online", status.wait(1)[0][3] == "online")
        here.bridge.kill()
        expect("its will says when it is gone", status.wait(2)[1][3] == "offline")
        older = here.start_bridge("--protocol=3.1.1", "--queue=marks")
        until("subscribed", lambda: here.status()["topics"] >= 3)
        here.count_up(1)
        packet = json.loads(each.wait(4)[3][3])
        expect("without properties they are around the packet", packet["packet"]["n"] == 4 and packet["history"] is False and packet["number"] > 0, packet)
        older.kill()
        for wrong, why in (("--protocol=3.1.1 --allow-calls=true", "MQTT 5"), ("--prefix=a/#", "wildcard"), ("--ca-file=x", "mqtts")):
            ended = here.start_bridge(*wrong.split(), wait=False)
            expect(f"{wrong} is refused", ended.process.wait(LIMIT_S) != 0 and why in ended.text(), ended.text())
        here.start_bridge("--encoding=protobuf")
        schema = here.subscribe("ise/schema/crew/counter/state", "schema", "-F", "%t|%r|%P|%x").wait(1)
        expect("a protobuf topic has its descriptors", schema[0][2]["message"].endswith("tally") and b"tally".hex() in schema[0][3], schema)


def nothing_lost_nothing_twice(folder):
    with System(folder) as here:
        options = ("--queue=marks", f"--store={folder}/store")
        here.start_bridge(*options)
        each = here.subscribe("ise/out/crew/counter/marks", "each")
        here.count_up(100)
        each.wait(100)
        until("all are confirmed", lambda: here.status()["queued"] == 0)
        # The broker is killed, the bridge with it, and both come back.
        here.relay.cut()
        here.broker.kill()
        until("the bridge knows", lambda: not here.status()["connected"])
        here.count_up(600)

        def stored():
            with sqlite3.connect(f"file:{folder}/store?mode=ro", uri=True) as store:
                return store.execute("SELECT count(*) FROM queue").fetchone()[0]

        until("all wait on disk", lambda: stored() == 600)
        here.bridge.kill()
        here.start_bridge(*options, wait=False)
        until("the bridge knows the crew", lambda: here.status()["topics"] >= 3)
        expect("it has kept them", here.status()["queued"] == 600, here.status())
        here.count_up(100)
        here.start_broker()
        until("the subscriber is back", lambda: "Sending SUBACK" in here.broker.text())
        here.relay.heal(here.port)
        got = each.wait(800)
        # The connection is cut again and again while messages flow.
        for _ in range(3):
            here.count_up(200)
            here.relay.cut()
            here.relay.heal(here.port)
            until("it is connected again", lambda: here.status()["connected"])
        until("all are confirmed", lambda: here.status()["queued"] == 0)
        here.count_up(1)
        seen, numbers, marked = [], set(), 0

        def look():
            seen.clear()
            numbers.clear()
            for topic, retained, properties, payload in each.all():
                if properties["number"] in numbers:
                    expect("what comes again is marked", properties.get("resent") == "true", payload)
                    continue
                numbers.add(properties["number"])
                seen.append(json.loads(payload)["n"])
            return seen and seen[-1] == 1401

        until("the last one comes", look)
        expect("nothing is lost, nothing comes twice, and in order", seen == list(range(1, 1402)), [n for n, m in zip(seen, range(1, 1402)) if n != m][:5])
        old = [json.loads(one[3])["n"] for one in got if one[2].get("history")]
        expect("what waited is marked as history", old == list(range(101, 801)), old[:3] + old[-3:])
        expect("and has its own time", len({one[2]["published"] for one in got}) >= 3)
        expect("the store is empty", until("it is emptied", lambda: stored() == 0))


def calls_run_once(folder):
    with System(folder) as here:
        options = ("--allow-calls=true", "--publish=weather", f"--store={folder}/store")
        here.start_bridge(*options)
        answers = here.subscribe("answers/me", "answers", "-F", "%t|%r|%P|%D %p")
        pulls = lambda: here.call("crew/winch", "pulls")["times"]
        here.ask("crew/winch/pull", '{"number":1}', "request-0001")
        first = answers.wait(1)[0]
        expect("a call is answered", first[2]["code"] == "ok" and "request-0001" in first[3] and '"times":1' in first[3], first)
        here.ask("crew/winch/pull", '{"number":1}', "request-0001")
        expect("the same request gets the same answer", answers.wait(2)[1] == first, answers.all())
        here.bridge.kill()
        here.start_bridge(*options)
        here.ask("crew/winch/pull", '{"number":1}', "request-0001")
        expect("also from another life of the bridge", answers.wait(3)[2] == first, answers.all())
        expect("and was executed once", pulls() == 1, pulls())
        here.ask("crew/winch/pull", '{"number":1,"slow":true}', "request-0002")
        until("it is executed", lambda: pulls() == 2)
        here.ask("crew/winch/pull", '{"number":1,"slow":true}', "request-0002")
        here.bridge.kill()
        here.start_bridge(*options)
        here.ask("crew/winch/pull", '{"number":1,"slow":true}', "request-0002")
        cut = answers.wait(4)[3]
        expect("of one that was cut off nobody knows", cut[2] | {"code": "peer_lost", "execution": "unknown"} == cut[2], cut)
        expect("it is not executed again", pulls() == 2, pulls())
        refused = [
            ("crew/winch/pull", '{"number":-1}', "request-0003", "refused", "forward only"),
            ("crew/winch/pull", '{"number":"x"}', "request-0004", "type_mismatch|malformed", "number"),
            ("crew/winch/pull", '{"number":2}', "request-0001", "invalid_argument", "its own"),
            ("crew/winch/pull", '{"number":2}', "short", "invalid_argument", "UUID"),
            ("crew/winch/push", "{}", "request-0005", "no_such_service", "push"),
            ("crew/nobody/push", "{}", "request-0006", "no_such_name", "nobody"),
        ]
        for number, (service, request, correlation, code, text) in enumerate(refused):
            here.ask(service, request, correlation)
            got = answers.wait(5 + number)[4 + number]
            expect(f"{service} {request} fails with {code}", re.fullmatch(code, got[2]["code"]) and got[2]["execution"] == "not_executed" and text in got[3], got)
        here.publish("ise/call/crew/winch/pull", '{"number":1}')
        until("a request without response topic is counted", lambda: here.status()["not_published"] == 1)
        for count, topic in enumerate(["ise/in/weather", "ise", "answers/" + "x" * 3000], 2):
            here.publish("ise/call/crew/winch/pull", '{"number":1}', "-D", "publish", "response-topic", topic, "-D", "publish", "correlation-data", "request-0008")
            until(f"so is one that is to be answered at {topic[:20]}", lambda: here.status()["not_published"] == count)
        here.publish("ise/call/crew/winch/pull", '{"number":1}', "-r", "-D", "publish", "response-topic", "answers/me", "-D", "publish", "correlation-data", "request-0009")
        until("a retained one is not executed", lambda: here.status()["not_published"] == 5)
        expect("nor were the others", pulls() == 2, pulls())
        here.bridge.says("MQTT clients may publish")
        here.publish("ise/in/weather", '{"speed":12.5}')
        until("the winch hears of it", lambda: here.call("crew/winch", "heard")["speed"] == 12.5)
        before = here.status()["not_published"]
        here.publish("ise/in/weather", "no JSON")
        here.publish("ise/in/other", "{}")
        until("what is none is counted", lambda: here.status()["not_published"] == before + 2)
        here.bridge.kill()
        here.start_bridge()
        told = here.publish("ise/call/crew/winch/pull", '{"number":1}', "-D", "publish", "response-topic", "answers/me", "-D", "publish", "correlation-data", "request-0010", "-d")
        expect("by default nobody listens to requests", "No matching subscribers" in told or "(Mid: 1, RC:16)" in told, told)
        expect("and nothing was executed", pulls() == 2, pulls())


def policy_refuses(folder):
    uid = os.getuid()
    access = f"""version = 1
system = "crew"
[[allow]]
who = ["unix:{uid}"]
call = ["crew/**:{{count_up,pulls,heard}}", "ise/mqtt:status"]
subscribe = ["crew/counter:{{marks,state}}", "ise/mqtt:weather"]
name = ["**"]
read = ["**"]
"""
    with System(folder, access=access) as here:
        here.start_bridge("--allow-calls=true", wait=False)
        here.bridge.says("ready: ")
        here.bridge.says("'crew/counter/secret' cannot be subscribed to")
        answers = here.subscribe("answers/me", "answers")
        until("the bridge knows the crew", lambda: here.status()["topics"] >= 3)
        here.ask("crew/winch/pull", '{"number":1}', "request-0001")
        got = answers.wait(1)[0]
        expect("the policy refuses the bridge", got[2]["code"] == "access_denied" and got[2]["execution"] == "not_executed" and "pull" in got[3], got)


def secured(folder):
    def openssl(*words):
        done = subprocess.run(["openssl", *words], cwd=folder, capture_output=True, text=True, check=False)
        expect(f"openssl {words[0]}", done.returncode == 0, done.stderr)

    def authority(name):
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "30", "-keyout", f"{name}.key", "-out", f"{name}.pem", "-subj", f"/CN={name}")

    def certificate(name, by):
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj", f"/CN={name}")
        (folder / "san").write_text("subjectAltName=IP:127.0.0.1,DNS:localhost")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", f"{by}.pem", "-CAkey", f"{by}.key", "-CAcreateserial", "-days", "30", "-extfile", "san", "-out", f"{name}.pem")
        (folder / f"{name}.key").chmod(0o600)

    authority("harbour")
    authority("pirates")
    for name, by in (("broker", "harbour"), ("bridge", "harbour"), ("stranger", "pirates")):
        certificate(name, by)
    (folder / "users").write_text("")
    (folder / "users").chmod(0o600)
    done = subprocess.run(["mosquitto_passwd", "-b", folder / "users", "boat", "open sesame"], capture_output=True, text=True, check=False)
    expect("there is a user", done.returncode == 0, done.stderr)
    (folder / "acl").write_text("user boat\ntopic readwrite ise/status\ntopic write ise/out/crew/counter/marks\n")
    (folder / "acl").chmod(0o600)
    for name, text in (("right", "open sesame\n"), ("wrong", "open barley\n"), ("loose", "open sesame\n")):
        (folder / name).write_text(text)
        (folder / name).chmod(0o644 if name == "loose" else 0o600)
    broker = f"listener 0 127.0.0.1\nallow_anonymous false\npassword_file {folder}/users\nacl_file {folder}/acl\ncafile {folder}/harbour.pem\ncertfile {folder}/broker.pem\nkeyfile {folder}/broker.key\nrequire_certificate true\n"
    mine = ("--ca-file=harbour.pem", "--certificate=bridge.pem", "--key-file=bridge.key")
    with System(folder, broker) as here:
        wrongs = [
            (("--user=boat", "--password-file=wrong", *mine), "does not accept user 'boat'"),
            (("--user=boat", "--password-file=right", "--ca-file=pirates.pem", *mine[1:]), "certificate"),
            (("--user=boat", "--password-file=right", mine[0], "--certificate=stranger.pem", "--key-file=stranger.key"), "certificate|ca"),
        ]
        for options, why in wrongs:
            bridge = here.start_bridge(*options, wait=False, scheme="mqtts")
            told = bridge.says("no connection to the broker[^\n]*").group(0)
            expect(f"{options} is refused", re.search(why, told) and "ready: " not in bridge.text(), told)
            bridge.kill()
        loose = here.start_bridge("--user=boat", "--password-file=loose", *mine, wait=False, scheme="mqtts")
        expect("a password that others can read is refused", loose.process.wait(LIMIT_S) != 0 and "--password-file" in loose.text(), loose.text())
        bridge = here.start_bridge("--user=boat", "--password-file=right", "--queue=marks", *mine, scheme="mqtts")
        line = Path(f"/proc/{bridge.process.pid}/cmdline").read_bytes()
        expect("nobody sees the password", b"sesame" not in line and b"--password-file=right" in line, line)
        here.count_up(5)
        until("what the broker refuses is told", lambda: here.status()["refused"] > 0 and "crew/counter/" in here.status()["trouble"])
        until("and what it allows goes", lambda: here.status()["queued"] == 0 and here.status()["messages"] >= 6)


def others_client(folder):
    with System(folder) as here:
        here.start_bridge("--queue=marks", "--allow-calls=true", "--publish=weather", f"--store={folder}/store")
        here.bridge.says("MQTT clients may publish")
        here.count_up(2)
        script = Path(__file__).with_name("check_mqtt.mjs")
        done = subprocess.run([NODE, script, f"mqtt://127.0.0.1:{here.port}"], capture_output=True, text=True, timeout=LIMIT_S, check=False)
        expect("MQTT.js is content", done.returncode == 0, done.stdout + done.stderr)
        expect("its request ran once", here.call("crew/winch", "pulls")["times"] == 1)
        until("its gust is heard", lambda: here.call("crew/winch", "heard")["speed"] == 7.5)


def main():
    global PROGRAMS, CREW, NODE, MOSQUITTO
    if len(sys.argv) not in (3, 4):
        print(__doc__, file=sys.stderr)
        return 2
    PROGRAMS, CREW = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    NODE = sys.argv[3] if len(sys.argv) == 4 else None
    MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin")
    if not MOSQUITTO or not shutil.which("mosquitto_sub"):
        print("test skipped: mosquitto and its clients are not installed (cmake/install-packages test)")
        return 77
    stories = [others_client] if NODE else [what_goes_out, nothing_lost_nothing_twice, calls_run_once, policy_refuses, secured]
    only = os.environ.get("STORY")
    for story in stories:
        if only and story.__name__ != only:
            continue
        began = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="ise-mqtt-") as name:
            try:
                story(Path(name))
            except Failed as problem:
                print(f"{story.__name__}: {problem}", file=sys.stderr)
                return 1
        print(f"{story.__name__}: {time.monotonic() - began:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
