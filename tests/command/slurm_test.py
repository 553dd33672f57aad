#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Bakes thousands of files by examples/slurm/bake.sh, on a Slurm of this machine with a controller and two nodes. Both are
killed at random times with all that runs on them. Afterwards every file must be there, with the bytes that one process makes.

usage: slurm_test.py VELLUM [--files N] [--tasks N] [--kills N] [--seed N] [--work FOLDER]
Needs Slurm's daemons, and no rights: they run as this user, without munge.
"""
import argparse
import collections
import contextlib
import hashlib
import json
import os
import pathlib
import random
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import zlib

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / "examples/slurm/bake.sh"
NODES = ("n1", "n2")
LONGEST = 1800  # seconds for the whole job
MOST_SUBMISSIONS = 10
STUCK = 60  # seconds without a task that ends


# Models: a fan of triangles on a texture of noise and blobs, every one different, the texture within the file or beside it.

def png(numbers, size):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    blobs = [(numbers.random() * size, numbers.random() * size, numbers.uniform(0.1, 0.3) * size) for _ in range(4)]
    rows = bytearray()
    for y in range(size):
        rows.append(0)
        for x in range(size):
            inside = any((x - bx) ** 2 + (y - by) ** 2 < r * r for bx, by, r in blobs)
            rows += bytes((90, 140, 60, 255 if inside else 0))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 6, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(bytes(rows), 1)) + chunk(b"IEND", b""))


def write_model(path, numbers):
    triangles = numbers.randint(1, 12)
    corners = [(numbers.random(), numbers.random()) for _ in range(3 * triangles)]
    mesh = b"".join(struct.pack("<3f", x, y, i % 7) for i, (x, y) in enumerate(corners))
    mesh += b"".join(struct.pack("<2f", *corner) for corner in corners)
    image = png(numbers, numbers.choice((8, 16, 24)))
    views = [{"buffer": 0, "byteLength": 36 * triangles}, {"buffer": 0, "byteOffset": 36 * triangles, "byteLength": 24 * triangles}]
    model = {
        "asset": {"version": "2.0"},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "accessors": [{"bufferView": view, "componentType": 5126, "count": 3 * triangles, "type": kind}
                      for view, kind in ((0, "VEC3"), (1, "VEC2"))],
        "bufferViews": views,
    }
    for end, of in (("min", min), ("max", max)):
        model["accessors"][0][end] = [of(struct.unpack_from("<f", mesh, 12 * i + 4 * axis)[0] for i in range(3 * triangles))
                                      for axis in range(3)]
    if path.suffix == ".gltf":
        path.with_suffix(".bin").write_bytes(mesh)
        path.with_suffix(".png").write_bytes(image)
        model["buffers"] = [{"uri": f"{path.stem}.bin", "byteLength": len(mesh)}]
        model["images"] = [{"uri": f"{path.stem}.png"}]
        path.write_text(json.dumps(model))
        return
    views.append({"buffer": 0, "byteOffset": len(mesh), "byteLength": len(image)})
    binary = mesh + image + b"\0" * (-len(image) % 4)
    model["buffers"] = [{"byteLength": len(binary)}]
    model["images"] = [{"bufferView": 2, "mimeType": "image/png"}]
    text = json.dumps(model).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)) + struct.pack("<I4s", len(text), b"JSON") + text +
                     struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def write_models(folder, count, numbers):
    folder.mkdir()
    names = []
    for i in range(count):
        folder_of = folder / f"{i // 500:03}"
        folder_of.mkdir(exist_ok=True)
        path = folder_of / f"{i:05}.{'gltf' if i % 5 == 0 else 'glb'}"
        write_model(path, numbers)
        names.append(path)
    return names


# Slurm

def free_ports(count):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [each.getsockname()[1] for each in sockets]


def environment_of(process):
    with contextlib.suppress(OSError):
        return dict(entry.split(b"=", 1) for entry in pathlib.Path(f"/proc/{process}/environ").read_bytes().split(b"\0") if b"=" in entry)
    return {}


def parent_of(process):
    with contextlib.suppress(OSError):
        return int(pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1])
    return 0


class Slurm:
    """A controller and nodes of one processor each, with their state in a folder."""

    def __init__(self, folder, path):
        self.folder = folder
        folder.mkdir()
        user, host = subprocess.run(["id", "-un"], check=True, text=True, stdout=subprocess.PIPE).stdout.strip(), socket.gethostname()
        ports = free_ports(1 + len(NODES))
        lines = [
            "ClusterName=vellum", f"SlurmctldHost={host}(127.0.0.1)", f"SlurmctldPort={ports[0]}",
            f"SlurmUser={user}", f"SlurmdUser={user}", "AuthType=auth/none", "CredType=cred/none",
            f"StateSaveLocation={folder}/state", f"SlurmdSpoolDir={folder}/%n",
            f"SlurmctldPidFile={folder}/slurmctld.pid", f"SlurmdPidFile={folder}/%n.pid",
            f"SlurmctldLogFile={folder}/slurmctld.log", f"SlurmdLogFile={folder}/%n.log",
            "ProctrackType=proctrack/pgid", "TaskPlugin=task/none", "SelectType=select/linear", "SwitchType=switch/none",
            "MpiDefault=none", "JobAcctGatherType=jobacct_gather/none", "AccountingStorageType=accounting_storage/none",
            # How long a node must be silent until its tasks start elsewhere, and how long a task must wait then.
            "SlurmdTimeout=15", "ReturnToService=2", "KillWait=1", "AuthInfo=cred_expire=30", "MinJobAge=3600",
            "SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=0", "MaxArraySize=10001",
            *(f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1 State=UNKNOWN"
              for node, port in zip(NODES, ports[1:])),
            f"PartitionName=all Nodes={','.join(NODES)} Default=YES MaxTime=INFINITE State=UP",
        ]
        (folder / "state").mkdir()
        (folder / "slurm.conf").write_text("\n".join(lines) + "\n")
        self.env = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf"), "PATH": f"{path}:/usr/sbin:{os.environ['PATH']}"}
        self.daemons = {}

    def start(self, name):
        words = ["slurmctld", "-D"] if name == "controller" else ["slurmd", "-D", "-N", name]
        self.daemons[name] = subprocess.Popen(words, env=self.env, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                              stderr=subprocess.DEVNULL, start_new_session=True)

    def kill(self, name):
        """Kills a daemon, and a node with all that runs on it."""
        self.daemons[name].kill()
        self.daemons[name].wait()
        if name != "controller":
            self.kill_tasks(name)

    def kill_tasks(self, node):
        slurm = str(self.folder / "slurm.conf").encode()
        found = set()
        for entry in os.listdir("/proc"):
            environment = environment_of(entry) if entry.isdigit() else {}
            if environment.get(b"SLURMD_NODENAME") == node.encode() and environment.get(b"SLURM_CONF") == slurm:
                found.update((int(entry), parent_of(entry)))  # a task, or what it started, and slurmstepd above it
        for process in found - {0, 1, os.getpid()}:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def run(self, *words, check=True):
        done = subprocess.run(words, env=self.env, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120)
        if check and done.returncode != 0:
            raise SystemExit(f"{' '.join(words)}: {done.stdout}")
        return done.stdout

    def ready(self):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            if self.run("sinfo", "-h", "-N", "-o", "%N %t", check=False).count("idle") == len(NODES):
                return
            time.sleep(0.5)
        raise SystemExit(f"the nodes are not idle: {self.run('sinfo', '-N', '-l', check=False)}")

    def left(self, job):
        """The tasks that have not ended, or None while the controller does not answer."""
        done = subprocess.run(("squeue", "-h", "-r", "-j", job, "-o", "%i"), env=self.env, check=False, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=120)
        if done.returncode == 0 or "Invalid job id" in done.stderr:  # which it is when all have ended
            return done.stdout.split()
        return None

    def resume_nodes(self):
        """A controller that was killed may start a task that runs already, and then takes the node out of service."""
        for line in self.run("sinfo", "-h", "-N", "-o", "%N %t", check=False).splitlines():
            if line.split()[-1].startswith(("dr", "down")):
                self.run("scontrol", "update", f"nodename={line.split()[0]}", "state=resume", check=False)

    def stop(self):
        for name in list(self.daemons):
            self.kill(name)


def files_in(folder):
    found = {}
    for path in folder.rglob("*"):
        with contextlib.suppress(FileNotFoundError, IsADirectoryError):  # renamed meanwhile
            found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).digest()
    return found


def run_job(slurm, options, out, numbers, expected, killed, kills, words):
    """Submits the example, and kills until `kills` are counted in `killed`. Returns seconds until no task is left."""
    start = time.monotonic()
    job = slurm.run("sbatch", "--parsable", *words, f"--array=1-{options.tasks}", str(EXAMPLE), str(options.list), str(out)).strip()
    before, changed, next_kill = None, start, start + numbers.uniform(4, 12)
    while True:
        left = slurm.left(job)
        if left == []:
            break
        if left != before:
            before, changed = left, time.monotonic()
        if time.monotonic() - changed > STUCK:
            # One that ended while the controller was dead counts as running until Slurm asks its node again, and one whose
            # node died at its start is held.
            slurm.run("scontrol", "requeue", ",".join(left or []), check=False)
            slurm.run("scontrol", "release", ",".join(left or []), check=False)
            changed = time.monotonic()
        if time.monotonic() - start > LONGEST:
            raise SystemExit(f"not done after {LONGEST} s: {left} are left")
        if sum(killed.values()) < kills and time.monotonic() > next_kill:
            name = numbers.choice(("controller", *NODES))
            slurm.kill(name)
            killed[name] += 1
            # What is written under its name is whole at any time.
            broken = [file for file, digest in files_in(out).items() if expected.get(file, digest) != digest]
            if broken:
                raise SystemExit(f"half-written after {name} was killed: {broken[:5]}")
            time.sleep(numbers.uniform(0, 3))
            slurm.start(name)
            next_kill = time.monotonic() + numbers.uniform(4, 12)
        slurm.resume_nodes()
        time.sleep(0.3)
    return time.monotonic() - start


def compare(found, expected):
    """The files that differ, that are missing, and that are too many."""
    return ([name for name in expected if name in found and found[name] != expected[name]],
            [name for name in expected if name not in found], [name for name in found if name not in expected])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vellum", type=pathlib.Path)
    parser.add_argument("--files", type=int, default=10000)
    parser.add_argument("--tasks", type=int, default=64)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=pathlib.Path, help="an empty folder that is kept")
    options = parser.parse_args()
    if not shutil.which("slurmctld", path=f"/usr/sbin:{os.environ['PATH']}"):
        raise SystemExit("slurmctld is not installed: scripts/setup slurm")
    numbers = random.Random(options.seed)
    with contextlib.ExitStack() as stack:
        work = options.work or pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="vellum-slurm-")))
        options.list = work / "models.list"
        options.list.write_text("".join(f"{name}\n" for name in write_models(work / "models", options.files, numbers)))
        start = time.monotonic()
        subprocess.run([options.vellum, "bake", "--files", options.list, "-o", work / "one", "--threads", "1", "--quiet"], check=True)
        print(f"{options.files} files by one thread: {time.monotonic() - start:.0f} s", flush=True)
        expected = files_in(work / "one")
        slurm = Slurm(work / "slurm", options.vellum.resolve().parent)
        stack.callback(slurm.stop)
        for name in ("controller", *NODES):
            slurm.start(name)
        slurm.ready()

        failed = False
        for label, words, kills in (("one node", ("-w", NODES[0]), 0), ("two nodes", (), 0), ("two nodes, killed", (), options.kills)):
            out = work / label.replace(" ", "-").replace(",", "")
            out.mkdir()
            seconds, killed, submissions = 0, collections.Counter(), 0
            # Slurm ends a task now and then, and a controller that was killed forgets some. Another submission skips what is done.
            found = {}
            while submissions < MOST_SUBMISSIONS and found.keys() != expected.keys():
                seconds += run_job(slurm, options, out, numbers, expected, killed, kills, words)
                submissions += 1
                found = files_in(out)
            differing, missing, more = compare(found, expected)
            text = f" ({', '.join(f'{name} {count}' for name, count in sorted(killed.items()))})" if killed else ""
            print(f"{label}{text}: {seconds:.0f} s, {submissions} submission{'s' if submissions > 1 else ''}; {len(missing)} lost, "
                  f"{len(differing)} differ, {len(more)} left over", flush=True)
            failed = failed or bool(differing or missing or more) or sum(killed.values()) < kills / 2
        return int(failed)


if __name__ == "__main__":
    sys.exit(main())
