"""The scenes' rules on a cluster of two nodes, which is brought up on this machine and taken away again (make test-slurm).

Nothing of a Slurm that the machine has already is used: cluster.sh keeps its configuration, key, socket, spool and logs in a folder of its own.
"""
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import BUILD, TOP, environment, run
from ilf_util import read_mosaic
from process import Process, execute

HERE = Path(__file__).resolve().parent
SYSTEM = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
NEEDED = "slurmctld slurmd munged srun salloc squeue scancel sinfo".split()
MISSING = [p for p in NEEDED if not shutil.which(p, path=SYSTEM)]
if not os.environ.get("ILF_SLURM"):
    pytestmark = pytest.mark.skip(reason="brings a cluster up: make test-slurm runs it")
elif MISSING:
    pytestmark = pytest.mark.skip(reason=f"not found: {' '.join(MISSING)} (packages slurmctld slurmd slurm-client munge)")

ROOM = ("void light l\n0\n0\n3 300 200 100\nl sphere lamp\n0\n0\n4 .2 .1 1.5 .2\nvoid plastic m\n0\n0\n5 .6 .5 .4 .05 .1\n"
        "m sphere ball\n0\n0\n4 .5 .6 .5 .3\nm polygon floor\n0\n0\n12 -2 -2 -.1 2 -2 -.1 2 2 -.1 -2 2 -.1\n"
        "m polygon wall\n0\n0\n12 -2 2 -.1 2 2 -.1 2 2 2 -2 2 2\n")
VIEW = "rvu -vtv -vp 0 -2 1 -vd 0 1 -.2 -vu 0 0 1 -vh 60 -vv 45\n"
SESSION = """[grid]
nodes = 2x2
plane = -.15 -.1 0  .3 0 0  0 .2 0
[stage]
port = port
unit_mm = 1000
origin = -600 -500
feed = 6000
settle = 0.1
[camera]
exposures = 1/256 1/4
command = virtualcamera --quiet --octree room.oct --plane "{plane}" --at {x},{y} --seconds {seconds} --size 48 --response srgb
  --supersample 1 --refine 0 --no-noise --cache views/{i}_{j} --render-options "-us 1 -ab 1 -ad 64 -aa .2 -af views/{i}_{j}/room.amb" -o {file}
depends = room.oct
[output]
folder = out
[chain]
before = oconv -f room.rad > room.oct
beside = virtualstage --with-parent --time-factor 1000 --link port
hdrgen = --response srgb
fishremap = --size 32x8 --polar-max 90
ilfpack = --type float
"""


def free_ports():
    """The first of three ports that nobody listens to."""
    for first in range(17000, 32000, 10):
        held = []
        try:
            for k in range(3):
                held.append(socket.socket())
                held[-1].bind(("", first + k))
            return first
        except OSError:
            continue
        finally:
            for h in held:
                h.close()
    pytest.fail("no three free ports")


class Cluster:
    """Two nodes, n1 and n2, of one processor each."""

    def __init__(self):
        self.folder = Path(tempfile.mkdtemp(prefix="ilfslurm", dir="/tmp"))     # a socket's name is short
        self.port = free_ports()
        try:
            self.tell("start")
        except BaseException:
            shutil.rmtree(self.folder)
            raise

    def tell(self, verb, *more):
        with open(self.folder / "err", "w+") as err:        # no pipe: the daemons would keep it open
            p = execute(["bash", HERE / "cluster.sh", verb, self.folder, *more], stdin=subprocess.DEVNULL, stdout=err, stderr=err,
                        start_new_session=True, env={**os.environ, "ILF_SLURM_PORT": str(self.port)})
        assert p.returncode == 0, (self.folder / "err").read_text()

    def close(self):
        self.tell("stop")
        shutil.rmtree(self.folder)

    def environment(self):
        return {**environment(MAKEFLAGS="", MAKELEVEL="", SLURM_CONF=str(self.folder / "slurm.conf")), "PATH": f"{environment()['PATH']}:/usr/sbin:/sbin"}

    def ask(self, *command):
        return execute(command, env=self.environment(), capture_output=True, check=True, text=True).stdout

    def running(self):
        return self.ask("squeue", "-h", "-t", "running", "-o", "%N").split()

    def ended(self):
        """[(step's name, state)] of the rules' jobs that have ended."""
        text = (self.folder / "jobs").read_text() if (self.folder / "jobs").exists() else ""
        return [(m[1].split(".")[1], m[2]) for m in re.finditer(r" Name=(ilf\.\S+) JobState=(\S+)", text)]

    def tasks(self, node):
        """Processes of a node's jobs, as their environment says."""
        found = []
        for p in Path("/proc").glob("[0-9]*"):
            try:
                words = (p / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            if b"SLURMD_NODENAME=" + node.encode() in words and f"SLURM_CONF={self.folder}/slurm.conf".encode() in words:
                found.append(int(p.name))
        return found

    def lose(self, node):
        """What a power cut does: its daemon, the daemons of its steps, and what those run are gone."""
        until(lambda: self.tasks(node), 60)
        doomed = {int((self.folder / f"slurmd.{node}.pid").read_text()), *self.tasks(node)}
        for p in list(doomed):
            try:
                parent = int(Path(f"/proc/{p}/stat").read_text().rpartition(")")[2].split()[1])
                if "(slurmstepd)" in Path(f"/proc/{parent}/stat").read_text():
                    doomed.add(parent)
            except OSError:
                continue
        for d in sorted(doomed):
            try:
                os.kill(d, signal.SIGKILL)
            except ProcessLookupError:
                pass


@pytest.fixture(scope="module")
def a_cluster():
    c = Cluster()
    yield c
    c.close()


@pytest.fixture
def cluster(a_cluster):
    """Both nodes there, nothing on them, before a test and after it."""
    yield a_cluster
    a_cluster.ask("scancel", "-u", str(os.getuid()))
    if "down" in a_cluster.ask("sinfo", "-h", "-n", "n2", "-o", "%T"):
        a_cluster.tell("node", "n2")
    until(lambda: a_cluster.ask("sinfo", "-h", "-t", "idle", "-o", "%D").strip() == "2", 60)


@pytest.fixture
def room(tmp_path):
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "room.rad").write_text(ROOM)
        (tmp_path / name / "view.vf").write_text(VIEW)
        (tmp_path / name / "s.conf").write_text(SESSION)
        (tmp_path / name / "room.oct").write_bytes(run("oconv", "-f", "room.rad", cwd=tmp_path / name).out)
    return tmp_path


def make(cluster, *words, code=0, before=(), **more):
    p = execute([*before, "make", "-C", TOP / "scenes", f"BUILD={BUILD}", "QUIET=--quiet", *words], env=cluster.environment(),
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    assert (p.returncode == 0) == (code == 0), p.stdout
    return p.stdout


def picture(folder, options, rows=4):
    return [f"PICTURE={folder}/a.hdr", f"OCTREE={folder}/room.oct", f"VIEW={folder}/view.vf", f"OPTIONS={options}", f"ROWS={rows}"]


def body(path):
    """A picture's bytes without the lines that say when and how it was made."""
    return re.sub(rb"(?m)^(CAPDATE|GMT|[^ \n]*rpict ).*\n", b"", path.read_bytes())


def leftovers(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if re.search(r"\.tmp$|\.part$|^\.[^.]+\..*\.\w{6}$", p.name))


FINE = "-x 64 -y 48 -ab 1 -aa .2 -ad 64"
SLOW = "-x 400 -y 300 -ab 2 -aa 0 -ad 60 -lw 0"      # some seconds a part
NEVER = "-x 4000 -y 3000 -ab 2 -aa 0 -ad 400 -lw 0"


def test_capture_is_the_one_that_this_machine_makes(cluster, room):
    make(cluster, f"CAPTURE={room}/here/s.conf", "-j2")
    before = len(cluster.ended())
    make(cluster, f"CAPTURE={room}/there/s.conf", "-j4", "ON=slurm", "PER_JOB=1")
    here, there = (np.asarray(read_mosaic(room / d / "out/room.ilf.exr")[1]) for d in ("here", "there"))
    assert np.array_equal(here, there) and here.max() > 0
    jobs = cluster.ended()[before:]
    assert {s for _, s in jobs} == {"COMPLETED"}
    assert sorted(n for n, _ in jobs) == ["merge"] * 4 + ["remap"] * 4 + ["view"] * 9       # five of them for the room's indirect light
    make(cluster, f"CAPTURE={room}/there/s.conf", "ON=slurm", "PER_JOB=1")
    assert len(cluster.ended()) == before + 17
    # several places a job, as is usual; one that fails leaves the others made
    for p in (room / "there/out").rglob("*.exr"):
        p.unlink()
    last = sorted((room / "there/out").glob("*/times.txt"))[-1]
    text = last.read_text()
    last.write_text("none.png 1\n")
    said = make(cluster, f"CAPTURE={room}/there/s.conf", "-j4", "ON=slurm", "PER_JOB=3", "-k", code=2)
    assert "none.png" in said and "slurm.sh: places: " in said, said
    made = {p for p in (room / "there/out").rglob("probe.exr")}
    last.write_text(text)
    make(cluster, f"CAPTURE={room}/there/s.conf", "-j4", "ON=slurm", "PER_JOB=3")
    assert len(made) == 3 and np.array_equal(here, np.asarray(read_mosaic(room / "there/out/room.ilf.exr")[1]))


def test_picture_is_the_one_that_this_machine_makes(cluster, room):
    make(cluster, *picture(room / "here", FINE), "-j2")
    make(cluster, *picture(room / "there", FINE), "-j4", "ON=slurm", "SLURM=-p short --time=5")
    assert body(room / "here/a.hdr") == body(room / "there/a.hdr")
    # as steps of one allocation
    (room / "there/a.hdr").unlink()
    shutil.rmtree(room / "there/a.rows")
    before = len(cluster.ended())
    make(cluster, *picture(room / "there", FINE), "-j2", "ON=slurm", before=["salloc", "-Q", "-N2", "-n2"])
    assert body(room / "here/a.hdr") == body(room / "there/a.hdr") and len(cluster.ended()) == before


def begin(cluster, room, options, **more):
    """A make with two jobs that run."""
    log = open(room / "log", "w")
    p = Process(["make", "-k", "-C", TOP / "scenes", f"BUILD={BUILD}", *picture(room / "there", options), "ON=slurm", "-j4"], env=cluster.environment(),
                stdout=log, stderr=log, start_new_session=True)
    try:
        until(lambda: len(cluster.running()) == 2, 60)
    except BaseException:
        os.killpg(p.pid, signal.SIGTERM)
        p.wait()
        raise
    return p


def until(true, seconds):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.2)


def test_a_lost_node_fails_its_own_step(cluster, room):
    p = begin(cluster, room, SLOW)
    cluster.lose("n2")
    p.wait()
    said = (room / "log").read_text()
    assert p.returncode != 0
    lost = re.findall(r"^slurm.sh: render: (\S+): expected job (\d+) to end well, found (\w+), exit status \d+$", said, re.M)
    assert len(lost) >= 1, said
    assert not leftovers(room / "there")
    made = {f.name: f.stat().st_mtime_ns for f in (room / "there/a.rows").glob("?.hdr")}
    # (those that n1 had were finished by it)
    assert len(made) + len(lost) == 4 and made and all(Path(f).name not in made for f, _, _ in lost)
    cluster.tell("node", "n2")
    until(lambda: "idle" in cluster.ask("sinfo", "-h", "-n", "n2", "-o", "%T"), 60)
    make(cluster, *picture(room / "there", SLOW), "-j4", "ON=slurm")
    assert all((room / "there/a.rows" / f).stat().st_mtime_ns == t for f, t in made.items())
    make(cluster, *picture(room / "here", SLOW), "-j2")
    assert body(room / "here/a.hdr") == body(room / "there/a.hdr")


def test_interrupt_cancels_what_was_queued(cluster, room):
    p = begin(cluster, room, NEVER)
    assert len(cluster.ask("squeue", "-h").split("\n")) == 5        # two wait
    os.killpg(p.pid, signal.SIGINT)
    p.wait()
    until(lambda: not cluster.ask("squeue", "-h").strip(), 30)
    assert p.returncode != 0 and not leftovers(room / "there") and not list((room / "there/a.rows").glob("?.hdr"))


def test_a_job_out_of_time_says_so(cluster, room):
    said = make(cluster, *picture(room / "there", NEVER, 2), "-j2", "ON=slurm", "SLURM=--time=0:01", code=2)
    assert re.search(r"^slurmstepd.*DUE TO TIME LIMIT", said, re.M), said
    assert len(re.findall(r"^slurm.sh: render: \S+/\d.hdr: expected job \d+ to end well, found TIMEOUT, exit status \d+$", said, re.M)) == 2, said
    assert not leftovers(room / "there") and not list((room / "there/a.rows").glob("?.hdr"))


def test_a_failing_program_says_what_it_said(cluster, room):
    (room / "there/view.vf").write_text("rvu -vtv -vp 0 0 0 -vd 0 0 0\n")
    said = make(cluster, *picture(room / "there", "-x 8 -y 8"), "ON=slurm", code=2)
    assert re.search(r"rpict: .*\n(.*\n)*slurm.sh: render: \S+: expected job \d+ to end well, found FAILED, exit status 1", said), said
