"""A run that Slurm ends at its wall time, requeues and finishes: the bits of a run that nobody ended.

    test_slurm.py FEMXDEM [FOLDER]    exit status 77, with the reason, where there is no Slurm, no right to start one or it is not asked for

Starts munged, slurmctld and two slurmd of its own, all below FOLDER (a temporary one by default) and with ports of their
own, and ends them. The job is validation/cluster/slurm.sh over both nodes, one rank a node.
"""

import os
import re
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CLUSTER = ROOT / "validation" / "cluster"
sys.path.insert(0, str(CLUSTER))
sys.dont_write_bytecode = True

from same_results import differences

SKIPPED = 77
SIGNAL_BEFORE_END = 30  # seconds; Slurm limits times to whole minutes
PROCESSOR_SECONDS = 200  # of the run, about: its first 30 s do not end it, on two free processors either
MOST = 900  # seconds in Slurm
MEASURED_AT = 5e-4  # the inertial number of the run that is timed; DEM steps, and with them the seconds, go with its inverse
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue", "mpirun")
CONFIGURATION = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmctldPidFile={folder}/ctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmdSpoolDir={folder}/spool-%n
SlurmctldLogFile={folder}/ctld.log
SlurmdLogFile={folder}/slurmd-%n.log
SlurmctldPort={port}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
ReturnToService=2
MpiDefault=none
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={port1} CPUs=2 RealMemory=1000 State=UNKNOWN
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={port2} CPUs=2 RealMemory=1000 State=UNKNOWN
PartitionName=debug Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP OverSubscribe=YES
"""


def skip(reason):
    print(f"skipped: {reason}")
    sys.exit(SKIPPED)


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Slurm:
    """A Slurm of nodes n1 and n2 on this machine, for as long as the object is entered."""

    def __init__(self, folder):
        self.folder, self.daemons = folder, []
        port, port1, port2 = free_ports(3)
        host = socket.gethostname().split(".")[0]
        (folder / "slurm.conf").write_text(
            CONFIGURATION.format(folder=folder, host=host, port=port, port1=port1, port2=port2))
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}

    def __enter__(self):
        munge = self.folder / "munge"
        for name in ("munge", "state", "spool-n1", "spool-n2"):
            (self.folder / name).mkdir(mode=0o755)
        (munge / "key").write_bytes(os.urandom(128))
        (munge / "key").chmod(0o600)
        names = [f"--{n}={munge / n}" for n in ("socket", "key-file", "pid-file", "log-file", "seed-file")]
        self.start("munged", "--foreground", *[n.replace("/key-file", "/key") for n in names])
        while not (munge / "socket").exists():
            self.check()
        self.start("slurmctld", "-D", "-f", self.folder / "slurm.conf")
        for node in ("n1", "n2"):
            self.start("slurmd", "-D", "-f", self.folder / "slurm.conf", "-N", node)
        until = time.time() + 30
        while "idle" not in (said := self.ask("sinfo", "-h", "-N", "-o", "%T")) or said.split() != ["idle", "idle"]:
            self.check()
            if time.time() > until:
                raise SystemExit(f"the nodes do not come up: {said}")
        return self

    def __exit__(self, *_):
        for daemon in reversed(self.daemons):
            daemon.terminate()
        for daemon in self.daemons:
            try:
                daemon.wait(timeout=10)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def start(self, program, *arguments):
        with open(self.folder / "daemons.txt", "a") as said:
            self.daemons.append(subprocess.Popen([shutil.which(program), *map(str, arguments)], stdout=said, stderr=said,
                                                 env=self.environment))

    def check(self):
        for daemon in self.daemons:
            if daemon.poll() is not None:
                raise SystemExit(f"{daemon.args[0]} has ended: {(self.folder / 'daemons.txt').read_text()[-2000:]}")
        time.sleep(0.1)

    def ask(self, *words):
        done = subprocess.run([str(w) for w in words], env=self.environment, capture_output=True, text=True)
        return done.stdout + done.stderr


def options(settings):
    return [word for setting in settings for word in ("--set", setting)]


def run(femxdem, case, out, settings):
    """Processor seconds of a run that nobody ends."""
    spent = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    before = spent()
    done = subprocess.run([femxdem, "run", case, "--out", out, *options(settings)], capture_output=True, text=True, cwd=out.parent)
    if done.returncode != 0:
        raise SystemExit(f"the run without Slurm: {done.stdout}{done.stderr}")
    return spent() - before


def main():
    femxdem = Path(sys.argv[1]).resolve()
    missing = [name for name in PROGRAMS if shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin:/sbin") is None]
    if missing:
        skip(f"not installed: {', '.join(missing)} (Debian: slurm-wlm munge)")
    if "FEMXDEM_TEST_SLURM" not in os.environ:
        skip("it takes minutes: FEMXDEM_TEST_SLURM=1 runs it")
    if os.geteuid() != 0:
        skip("only root can start the daemons")
    os.environ["PATH"] += ":/usr/sbin:/sbin"
    folder = Path(sys.argv[2] if len(sys.argv) > 2 else tempfile.mkdtemp(prefix="femxdem_slurm_")).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o755)
    case, results, started = CLUSTER / "stops.toml", folder / "results", time.time()
    settings = ["control.end_time=4", "control.step=0.02", "control.max_step=0.02", "output.checkpoint_every=1"]
    packings = f've.cache="{results / "packings"}"'
    used = run(femxdem, case, folder / "timed", [*settings, packings, "ve.seed=1", f"ve.inertial_number={MEASURED_AT}"])
    settings.append(f"ve.inertial_number={MEASURED_AT * used / PROCESSOR_SECONDS:.1e}")
    words = options(settings)
    used = run(femxdem, case, folder / "whole", [*settings, packings, "ve.seed=1"])
    print(f"without Slurm: {used:.0f} s of processor time, {settings[-1]}; {time.time() - started:.0f} s so far", flush=True)

    with Slurm(folder) as slurm:
        slurm.environment |= {
            "FEMXDEM": str(femxdem), "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1"}
        said = slurm.ask("sbatch", "--parsable", "-N", "2", "--ntasks-per-node=1", "--cpus-per-task=1", "--time=1",
                         f"--signal=B:USR1@{SIGNAL_BEFORE_END}", f"--output={folder}/job.log", f"--chdir={folder}",
                         CLUSTER / "slurm.sh", case, results, *words)
        if not re.fullmatch(r"\d+\n", said):
            raise SystemExit(f"sbatch: {said}")
        job, state, seen, pending, minutes, begin = said.strip(), "", [], 0, 1, time.time()
        while state not in ("COMPLETED", "FAILED", "TIMEOUT", "CANCELLED", "NODE_FAIL"):
            time.sleep(0.2)
            slurm.check()
            said = slurm.ask("scontrol", "show", "job", job)
            found = re.search(r"JobState=(\w+).*?Restarts=(\d+)", said, re.DOTALL)
            state = found.group(1)
            pending = pending + 1 if "Reason=BeginTime" in said else 0
            if pending == 15:  # a requeued job would wait for two minutes; Slurm has done with its last run by now
                minutes += 1  # so that it comes to its end on a busy machine too
                slurm.ask("scontrol", "update", f"JobId={job}", "StartTime=now", f"TimeLimit={minutes}")
            if found.groups() != (seen or [None])[-1]:
                seen.append(found.groups())
                print(f"{time.time() - started:5.1f} s  {state}, {found.group(2)} restarts", flush=True)
            if time.time() - begin > MOST:
                raise SystemExit("the job does not end: " + (folder / "job.log").read_text())
    log = (folder / "job.log").read_text()
    faults = [] if state == "COMPLETED" else [f"the job ended as {state}"]
    faults += [] if int(seen[-1][1]) >= 1 else ["it was not requeued"]
    faults += [] if "SIGUSR1: stopped and saved after step" in log else ["it was not told to end"]
    faults += differences(folder / "whole", results / "1") if not faults else []
    if faults:
        raise SystemExit("\n".join([*faults, log]))
    print(f"{seen[-1][1]} restarts, on both nodes, equal to the bit: {time.time() - started:.0f} s")
    if len(sys.argv) == 2:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
