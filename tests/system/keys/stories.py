#!/usr/bin/env python3
"""What `ise keys` makes, from outside: files and their modes, what it refuses, and whom tls:// lets in with it.

usage: stories.py ISE NAME_SERVER
openssl's own command is the second opinion.
"""

import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

LIMIT_S = 120
ISE, NAME_SERVER = "", ""


class Failed(Exception):
    pass


def clean():
    return {name: value for name, value in os.environ.items() if not name.startswith("ISE_")}


def run(words, folder, stdin=None):
    return subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, input=stdin, timeout=LIMIT_S, env=clean(), check=False)


def keys(folder, *words):
    """The command, which must succeed; what it printed."""
    done = run([ISE, "keys", *words], folder)
    if done.returncode != 0:
        raise Failed(f"ise keys {' '.join(map(str, words))}: {done.returncode}\n{done.stderr}")
    return done.stdout


def refused(folder, code, text, *words):
    done = run([ISE, "keys", *words], folder)
    if done.returncode != code or text not in done.stderr:
        raise Failed(f"ise keys {' '.join(map(str, words))}: expected {code} and '{text}', found {done.returncode}:\n{done.stderr}{done.stdout}")
    if done.stdout:
        raise Failed(f"it failed, and printed {done.stdout}")


def openssl(folder, *words, fails=None):
    done = run(["openssl", *words], folder)
    told = done.stdout + done.stderr
    if (done.returncode == 0) != (fails is None) or (fails and fails not in told):
        raise Failed(f"openssl {' '.join(map(str, words))}: {told}")
    return told


def expect(what, holds, found=""):
    if not holds:
        raise Failed(f"{what}; found:\n{found}")


def mode(file):
    return stat.S_IMODE(file.stat().st_mode)


def show(folder, file):
    return json.loads(keys(folder, "show", file, "--json"))


def files(folder):
    old = os.umask(0)  # modes must not depend on it
    try:
        keys(folder, "ca", "robots")
        keys(folder, "request", "ise://robots/shore", "--host", "localhost", "--host", "127.0.0.1", "--host", "::1")
        keys(folder, "request", "ise://robots/fleet/boat", "--host", "boat.local")
        keys(folder, "request", "ise://robots/laptop")
        keys(folder, "issue", "shore", "laptop")
        keys(folder, "issue", "boat/request.pem", "--boat")
    finally:
        os.umask(old)
    for secret in ("authority/ca-key.pem", "shore/key.pem", "boat/key.pem"):
        expect(f"{secret} is its owner's only", mode(folder / secret) == 0o600, oct(mode(folder / secret)))
    for own in ("authority", "shore", "boat"):
        expect(f"{own} is its owner's only", mode(folder / own) == 0o700, oct(mode(folder / own)))
    for public in ("authority/ca.pem", "shore/ca.pem", "shore/certificate.pem"):
        expect(f"{public} can be read", mode(folder / public) == 0o644, oct(mode(folder / public)))
    openssl(folder, "verify", "-x509_strict", "-purpose", "sslserver", "-CAfile", "shore/ca.pem", "shore/certificate.pem")
    openssl(folder, "verify", "-x509_strict", "-purpose", "sslclient", "-CAfile", "boat/ca.pem", "boat/certificate.pem")
    told = openssl(folder, "x509", "-in", "shore/certificate.pem", "-noout", "-ext", "subjectAltName,basicConstraints,keyUsage,extendedKeyUsage")
    for part in ("URI:ise://robots/shore", "DNS:localhost", "IP Address:127.0.0.1", "CA:FALSE", "Digital Signature", "TLS Web Server", "TLS Web Client"):
        expect(f"a certificate has {part}", part in told, told)
    for file in ("shore/key.pem", "authority/ca-key.pem"):
        body = "".join((folder / file).read_text().splitlines()[1:-1])
        told = keys(folder, "show", file)
        expect("show prints no private key", "private key" in told and body[:16] not in told and "EC P-256" in told, told)
        for other in folder.rglob("*"):
            if other.is_file() and other != folder / file:
                expect(f"{file} is nowhere else", body[24:64] not in other.read_text().replace("\n", ""), other)
    (one,) = show(folder, "shore/certificate.pem")
    expect("show knows whose it is", (one["kind"], one["identity"], one["hosts"]) == ("certificate", "ise://robots/shore", ["localhost", "127.0.0.1", "0:0:0:0:0:0:0:1"]), one)
    expect("and that nothing is wrong", one["trouble"] == "", one)
    keys(folder, "ca", "robots", "--authority", "lasting", "--days", "36500")
    keys(folder, "request", "ise://robots/probe")
    keys(folder, "issue", "probe", "--authority", "lasting", "--days", "20000")
    (one,) = show(folder, "probe/certificate.pem")
    told = openssl(folder, "x509", "-in", "probe/certificate.pem", "-noout", "-enddate", "-dateopt", "iso_8601")
    expect("a certificate may last beyond 2038", one["trouble"] == "" and one["valid_until"][:10] in told and one["valid_until"] > "2080", f"{told}{one}")
    names = [each["kind"] for each in show(folder, "shore")]
    expect("a folder is all of its files", names == ["authority", "certificate", "request", "private key"], names)


def refusals(folder):
    before = {file: file.read_bytes() for file in folder.rglob("*.pem")}
    refused(folder, 1, "authority/ca-key.pem is there already; it is not replaced", "ca", "robots")
    refused(folder, 1, "shore/key.pem is there already", "request", "ise://robots/shore")
    refused(folder, 1, "shore/certificate.pem is there already", "issue", "shore")
    refused(folder, 1, "nowhere is no folder of an authority", "issue", "shore/request.pem", "--authority", "nowhere")
    for wrong in ("robots/shore", "ise://robots", "ise://robots/", "ise:///shore", "ise://robots/sh ore", "ise://robots/" + "x" * 65):
        refused(folder, 2, "is not an identity", "request", wrong, "--folder", "new")
    for wrong in ("a,DNS:b", "a/b", "a..b", ".a", "a b", "\u00e4"):
        refused(folder, 2, "is no name or address of a host", "request", "ise://robots/new", f"--host={wrong}")
    refused(folder, 2, "--days: from 1 to 36500, not 0", "ca", "other", "--authority", "new", "--days", "0")
    (name,) = requested(folder, "admiral")
    (folder / name).rename(folder / "visitor")
    why = "visitor/request.pem asks for ise://robots/admiral, not for a name that ends in /visitor"
    refused(folder, 1, why, "issue", "visitor")
    refused(folder, 1, "not for ise://robots/visitor", "issue", "visitor", "--identity", "ise://robots/visitor")
    expect("it was not signed", not (folder / "visitor/certificate.pem").exists())
    keys(folder, "issue", "visitor", "--identity", "ise://robots/admiral")
    shutil.rmtree(folder / "visitor")
    refused(folder, 1, "would outlive its authority", "issue", *requested(folder, "late"), "--days", "5000")
    refused(folder, 1, "'ghost' is no certificate, no folder with one, and nothing was issued to it", "revoke", "ghost")
    refused(folder, 1, "has nothing in PEM", "show", empty(folder))
    refused(folder, 1, "missing.pem", "show", "missing.pem")
    expect("no refusal left anything or changed anything", before == {file: file.read_bytes() for file in before})
    expect("nor a folder", not (folder / "new").exists())

    # Requests that somebody else made.
    (folder / "odd").mkdir(mode=0o700)
    req = ["req", "-new", "-nodes", "-keyout", "odd/key.pem", "-out", "odd/request.pem", "-subj", "/CN=x"]
    ec = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
    for options, why in (
        ([*ec], "has no URI"),
        ([*ec, "-addext", "subjectAltName=URI:ise://robots/a,URI:ise://robots/b"], "has several URIs"),
        ([*ec, "-addext", "subjectAltName=URI:ise://robots/a,email:a@b.c"], "no URI, host name or address"),
        ([*ec, "-addext", "subjectAltName=URI:ise://others/a"], "this authority signs for ise://robots/ only"),
        ([*ec, "-addext", "subjectAltName=URI:http://robots/a"], "is not an identity"),
        (["-newkey", "rsa:1024", "-addext", "subjectAltName=URI:ise://robots/a"], "is too weak"),
    ):
        openssl(folder, *req, *options)
        done = run([ISE, "keys", "issue", "odd"], folder)
        expect(f"a request that {why}", done.returncode in (1, 2) and why in done.stderr and "odd/request.pem" in done.stderr, done.stderr)
        expect("is not signed", not (folder / "odd/certificate.pem").exists())
    openssl(folder, *req, *ec, "-addext", "subjectAltName=URI:ise://robots/odd", "-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=keyCertSign")
    whole = (folder / "odd/request.pem").read_text()
    lines = whole.splitlines()
    middle = lines[2]
    lines[2] = middle[:10] + ("A" if middle[10] != "A" else "B") + middle[11:]
    (folder / "odd/request.pem").write_text("\n".join(lines) + "\n")
    done = run([ISE, "keys", "issue", "odd"], folder)
    expect("a request that was changed is not signed", done.returncode == 1 and not (folder / "odd/certificate.pem").exists(), done.stderr)
    (folder / "odd/request.pem").write_text(whole)
    keys(folder, "issue", "odd")
    told = openssl(folder, "x509", "-in", "odd/certificate.pem", "-noout", "-ext", "basicConstraints,keyUsage")
    expect("nobody becomes an authority by asking", "CA:FALSE" in told and "Certificate Sign" not in told, told)

    (folder / "authority/ca-key.pem").chmod(0o644)
    refused(folder, 1, "chmod 600", "issue", "late")
    (folder / "authority/ca-key.pem").chmod(0o600)


def requested(folder, name):
    keys(folder, "request", f"ise://robots/{name}")
    return (name,)


def empty(folder):
    (folder / "empty.txt").write_text("nothing\n")
    return "empty.txt"


def renewals(folder):
    before = (folder / "shore/certificate.pem").read_bytes()
    told = keys(folder, "renew", "shore")
    expect("what is good stays", (folder / "shore/certificate.pem").read_bytes() == before and "renewed from" in told, told)
    (old,) = show(folder, "shore/certificate.pem")
    keys(folder, "renew", "shore", "--now")
    (new,) = show(folder, "shore/certificate.pem")
    expect("it is another one", old["serial"] != new["serial"])
    same = ("identity", "hosts", "subject", "issuer")
    expect("for the same", all(old[field] == new[field] for field in same), new)
    keys_of = {openssl(folder, "x509", "-in", "shore/certificate.pem", "-noout", "-pubkey"), openssl(folder, "pkey", "-in", "shore/key.pem", "-pubout")}
    expect("with the same key", len(keys_of) == 1)
    signed_elsewhere(folder, "boat/request.pem", "old/certificate.pem", -25, 5)
    keys(folder, "renew", "old")
    (new,) = show(folder, "old/certificate.pem")
    expect("two thirds had passed", new["identity"] == "ise://robots/fleet/boat" and new["trouble"] == "", new)
    expect("by itself", "Signature ok" not in new)
    refused(folder, 1, "was not issued by this authority", "renew", "shore", "--now", "--authority", *foreign(folder))


def line_of(process):
    """The next line that it prints. The time that is waited is bounded by that of the whole test."""
    line = process.stdout.readline()
    if not line:
        raise Failed(f"it ended: {process.stderr.read()}")
    return line


def renewals_by_themselves(folder):
    refused(folder, 2, "--now renews once, --every whenever it is due", "renew", "shore", "--now", "--every", "12h")
    keys(folder, "request", "ise://robots/buoy", "--host", "127.0.0.1")
    signed_elsewhere(folder, "buoy/request.pem", "buoy/certificate.pem", -1, 29)
    (folder / "buoy/ca.pem").write_bytes((folder / "authority/ca.pem").read_bytes())
    words = [ISE, "keys", "renew", "nowhere-yet", "buoy", "--every", "200ms"]
    done = run(words, folder)
    expect("what is wrong from the start is an error", done.returncode == 1 and "nowhere-yet" in done.stderr, done.stderr)
    (old,) = show(folder, "buoy/certificate.pem")
    with NameServer(folder, "buoy") as names, subprocess.Popen([ISE, "keys", "renew", "shore", "buoy", "--every", "200ms"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean()) as renewing:
        try:
            for whose in ("shore", "buoy"):
                told = line_of(renewing)
                expect("what is good stays", whose in told and "is good until" in told, told)
            # Time passes: the certificate is one of which more than two thirds are over, and a folder is gone.
            (folder / "shore/certificate.pem").rename(folder / "shore/away.pem")
            signed_elsewhere(folder, "buoy/request.pem", "due.pem", -25, 5)
            (folder / "due.pem").replace(folder / "buoy/certificate.pem")
            told = line_of(renewing)
            expect("what is due is renewed, whatever becomes of the others", "buoy/certificate.pem is for ise://robots/buoy until" in told, told)
        finally:
            (folder / "shore/away.pem").rename(folder / "shore/certificate.pem")
            renewing.terminate()
            (_, complaints) = renewing.communicate()
        expect("and of those it says why not", "shore/certificate.pem" in complaints, complaints)
        (new,) = show(folder, "buoy/certificate.pem")
        expect("it is another one", new["serial"] != old["serial"] and new["trouble"] == "", new)
        host, port = names.at.removeprefix("tls://").split(":")
        shown = ""
        while f"serial={new['serial']}" not in shown:  # the name server reads it again; the limit of the test ends this
            told = run(["openssl", "s_client", "-connect", f"{host}:{port}", "-tls1_3", "-cert", "buoy/certificate.pem", "-key", "buoy/key.pem"], folder, stdin="").stdout
            shown = run(["openssl", "x509", "-noout", "-serial"], folder, stdin=told).stdout.strip()


def foreign(folder):
    if not (folder / "foreign").exists():
        keys(folder, "ca", "robots", "--authority", "foreign")
    return ("foreign",)


def signed_elsewhere(folder, request, certificate, begins, ends):
    """A certificate of the same authority, from so many days ago or until then, made by openssl."""
    (folder / certificate).parent.mkdir(mode=0o700, exist_ok=True)
    (folder / "index.txt").write_text("")
    (folder / "settings").write_text(
        "[ca]\ndefault_ca = here\n[here]\ndatabase = index.txt\nnew_certs_dir = .\ncertificate = authority/ca.pem\nprivate_key = authority/ca-key.pem\n"
        "rand_serial = yes\ndefault_md = sha256\npolicy = any\nunique_subject = no\ncopy_extensions = copy\n[any]\ncommonName = supplied\n"
    )
    at = lambda days: subprocess.run(["date", "-u", "-d", f"{days} days", "+%Y%m%d%H%M%SZ"], capture_output=True, text=True, check=True).stdout.strip()
    openssl(folder, "ca", "-batch", "-notext", "-config", "settings", "-startdate", at(begins), "-enddate", at(ends), "-in", request, "-out", certificate)


class NameServer:
    def __init__(self, folder, tls):
        self.process = subprocess.Popen([NAME_SERVER, "--fresh", "--listen", "tls://127.0.0.1:0", "--tls", str(folder / tls)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean())

    def __enter__(self):
        line = self.process.stdout.readline().split()
        if not line:
            raise Failed(f"the name server did not start: {self.process.stderr.read()}")
        self.at = line[-1]
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.communicate()


def transport(folder):
    former = folder / "former.pem"  # a copy that a thief kept
    former.write_bytes((folder / "laptop/certificate.pem").read_bytes())
    keys(folder, "renew", "laptop", "--now")
    keys(folder, "revoke", "laptop", "--into", "shore", "--into", "boat")
    openssl(folder, "verify", "-crl_check", "-CAfile", "shore/ca.pem", former, fails="revoked")
    openssl(folder, "verify", "-crl_check", "-CAfile", "shore/ca.pem", "laptop/certificate.pem", fails="revoked")
    openssl(folder, "verify", "-crl_check", "-CAfile", "shore/ca.pem", "boat/certificate.pem")
    refused(folder, 1, "it was revoked", "renew", "laptop", "--now")
    (_, listed) = show(folder, "shore/ca.pem")
    expect("the list is behind the authority", listed["kind"] == "revocation list" and len(listed["revoked"]) == len(set(listed["revoked"])) == 2, listed)
    keys(folder, "revoke", "ise://robots/laptop")
    (listed,) = show(folder, "authority/revoked.pem")
    expect("nothing is revoked twice", len(listed["revoked"]) == 2, listed)
    keys(folder, "renew", "shore")  # brings the list of the day
    (folder / "strange").mkdir(mode=0o700)
    keys(folder, "request", "ise://robots/strange", "--folder", "strange")
    keys(folder, "issue", "strange", "--authority", *foreign(folder))
    (folder / "strange/ca.pem").write_bytes((folder / "shore/ca.pem").read_bytes())  # it believes the right one
    signed_elsewhere(folder, "late/request.pem", "late/certificate.pem", -9, -1)
    (folder / "late/ca.pem").write_bytes((folder / "shore/ca.pem").read_bytes())
    with NameServer(folder, "shore") as names:

        def ask(tls, timeout):
            done = run([ISE, "--name-server", names.at, "--timeout", timeout, "--tls", folder / tls, "list"], folder)
            return done.returncode, done.stderr

        code, told = ask("boat", "60s")
        expect("who has a certificate of the authority is let in", code == 0, told)
        for who, why in (("laptop", "it was revoked"), ("strange", "not issued by an authority that is believed there"), ("late", "it has expired")):
            code, told = ask(who, "2s")
            expect(f"{who} is refused", code == 3 and why in told, told)
        keys(folder, "renew", "late")
        code, told = ask("late", "60s")
        expect("who was renewed is let in", code == 0, told)


def at_once(folder):
    """What several commands revoke at the same time is all in the list."""
    names = [f"guest{number}" for number in range(16)]
    keys(folder, "ca", "robots", "--authority", "busy")
    for name in names:
        requested(folder, name)
    keys(folder, "issue", *names, "--authority", "busy")
    start = lambda name: subprocess.Popen([ISE, "keys", "revoke", name, "--authority", "busy"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean())
    running = [start(name) for name in names]
    for process in running:
        (_, complaints) = process.communicate()
        expect("each of them succeeds", process.returncode == 0, complaints)
    (listed,) = show(folder, "busy/revoked.pem")
    serials = sorted(show(folder, f"{name}/certificate.pem")[0]["serial"] for name in names)
    expect("nothing that was revoked is missing", sorted(listed["revoked"]) == serials, listed)


def deployments(folder):
    """All that the hosts of a deployment file and its operators need, by one command."""
    (folder / "fleet.toml").write_text('name = "fleet"\n[hosts.boat]\n[hosts.ashore]\nserver = "shore"\n[components.one]\ntype = "one"\nhost = "boat"\n')
    command = ("deployment", "fleet.toml", "--operator", "ana", "--boat", "boat", "--host", "shore=shore.local", "--folder", "fleet")
    for wrong, why in (
        (("--boat", "ship"), "fleet.toml has no host 'ship'; it has boat"),
        (("--host", "ship=10.0.0.1"), "fleet.toml has no host 'ship'"),
        (("--host", "shore.local"), "--host"),
        (("--operator", "boat"), "'boat' is a host and cannot be an operator"),
    ):
        refused(folder, 2, why, "deployment", "fleet.toml", *wrong, "--folder", "none")
    refused(folder, 2, "nowhere.toml", "deployment", "nowhere.toml")
    keys(folder, *command)
    expect("each has a folder", sorted(one.name for one in (folder / "fleet").iterdir()) == ["ana", "authority", "boat", "shore"])
    for name, identity, hosts in (
        ("boat", "ise://fleet/boat", ["localhost", "127.0.0.1", "0:0:0:0:0:0:0:1"]),
        ("shore", "ise://fleet/shore", ["localhost", "shore.local", "127.0.0.1", "0:0:0:0:0:0:0:1"]),
        ("ana", "ise://fleet/operator/ana", []),
    ):
        (one,) = show(folder, f"fleet/{name}/certificate.pem")
        expect(f"{name} is itself", (one["identity"], sorted(one["hosts"]), one["trouble"]) == (identity, sorted(hosts), ""), one)
        expect(f"the key of {name} is its owner's only", mode(folder / f"fleet/{name}/key.pem") == 0o600)
        openssl(folder, "verify", "-x509_strict", "-CAfile", f"fleet/{name}/ca.pem", f"fleet/{name}/certificate.pem")
    days = {name: show(folder, f"fleet/{name}/certificate.pem")[0] for name in ("boat", "shore")}
    expect("the boat's is valid for longer", days["boat"]["valid_until"] > days["shore"]["valid_until"], days)
    before = {file: file.read_bytes() for file in (folder / "fleet").rglob("*.pem")}
    told = keys(folder, *command)
    expect("what is there stays", "has all of it already" in told and before == {file: file.read_bytes() for file in before}, told)
    keys(folder, *command, "--operator", "ben")
    (one,) = show(folder, "fleet/ben/certificate.pem")
    expect("who comes later is added", one["identity"] == "ise://fleet/operator/ben" and before == {file: file.read_bytes() for file in before}, one)


def main():
    global ISE, NAME_SERVER
    if len(sys.argv) != 3:
        print("usage: stories.py ISE NAME_SERVER", file=sys.stderr)
        return 2
    ISE, NAME_SERVER = (str(Path(one).resolve()) for one in sys.argv[1:])
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for story in (files, refusals, renewals, renewals_by_themselves, transport, at_once, deployments):
            story(folder)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as why:
        sys.exit(f"stories.py: {why}")
