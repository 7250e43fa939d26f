"""A Slurm of one node on this machine, from the packages of Debian."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import psutil

CONFIGURATION = Path("/etc/slurm")
MUNGE = Path("/run/munge")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "srun")
CORES = 2  # jobs at a time
# Daemons without control groups, which a container rarely lets them make; jobs are found by their processes.
TEXT = """
ClusterName=test
SlurmctldHost={host}
AuthType=auth/munge
CredType=cred/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerType=sched/backfill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
ReturnToService=2
SlurmdTimeout=15
KillWait=5
MinJobAge=300
SlurmUser=root
SlurmdUser=root
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmdSpoolDir={folder}/slurmd
StateSaveLocation={folder}/state
NodeName={host} CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=test Nodes={host} Default=YES MaxTime=600 State=UP
"""


class Missing(Exception):
    """Why there can be no Slurm on this machine, in a sentence."""


def install():
    """Install the packages of Debian and Ubuntu where they are missing."""
    if os.geteuid() != 0:
        raise Missing("only root can install and start a Slurm.")
    if all(map(shutil.which, PROGRAMS)):
        return
    if not shutil.which("apt-get"):
        raise Missing("Slurm is not installed, and there is no apt-get to install it.")
    for command in (
        ["update"],
        ["install", "--yes", "--no-install-recommends", "slurm-wlm", "munge"],
    ):
        process = subprocess.run(
            ["apt-get", "--quiet", *command],
            env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
            capture_output=True,
            text=True,
        )
        if process.returncode:
            raise Missing(
                f"apt-get {command[0]} failed: {process.stderr.strip().splitlines()[-1:]}"
            )


class Slurm:
    """Its daemons. The configuration is in its default place, where the programs of a job find it as well."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.host = socket.gethostname().split(".")[0]
        self.saved = self.folder / "saved"

    def start(self):
        """Start all daemons, and wait until the node takes jobs."""
        if self._is_answering():
            raise Missing("a Slurm is running on this machine, and is left alone.")
        for name in ("state", "slurmd"):
            (self.folder / name).mkdir()
        shutil.copytree(CONFIGURATION, self.saved) if CONFIGURATION.exists() else self.saved.mkdir()
        CONFIGURATION.mkdir(exist_ok=True)
        text = TEXT.format(
            host=self.host,
            folder=self.folder,
            cores=CORES,
            memory=psutil.virtual_memory().total // 2**20 * 9 // 10,
        )
        (CONFIGURATION / "slurm.conf").write_text(text, encoding="utf-8")
        self._start_munge()
        subprocess.run(["slurmctld"], check=True)
        self.start_node()

    def _start_munge(self):
        self.munge = None
        if subprocess.run(["munge", "--no-input"], capture_output=True).returncode == 0:
            return
        MUNGE.mkdir(exist_ok=True)
        shutil.chown(MUNGE, "munge", "munge")
        MUNGE.chmod(0o755)
        command = [
            "setpriv",
            "--reuid=munge",
            "--regid=munge",
            "--clear-groups",
            "munged",
            "--foreground",
        ]
        self.munge = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(
            lambda: subprocess.run(["munge", "--no-input"], capture_output=True).returncode == 0, 20
        )

    def start_node(self):
        """Start the daemon of the node, and wait until it takes jobs."""
        subprocess.run(["slurmd"], check=True)
        wait_for(
            lambda: self.query("sinfo", "--noheader", "--format=%t") in ("idle", "mix", "alloc"), 60
        )

    def fail_node(self):
        """What a loss of power does: the daemon of the node and all processes of its jobs are gone at once."""
        daemon = psutil.Process(int((self.folder / "slurmd.pid").read_text()))
        steps = [
            process
            for process in psutil.process_iter(["name"])
            if process.info["name"] == "slurmstepd"
        ]
        processes = [
            daemon,
            *(child for step in steps for child in step.children(recursive=True)),
            *steps,
        ]
        for process in processes:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        psutil.wait_procs(processes, timeout=20)

    def running_jobs(self):
        """Rules of the jobs that are running."""
        return self.query("squeue", "--noheader", "--states=RUNNING", "--format=%i %k").splitlines()

    def query(self, *command):
        """Output of one of the programs; empty if it fails."""
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()

    def _is_answering(self):
        return subprocess.run(["scontrol", "ping"], capture_output=True, text=True).stdout.endswith(
            "is UP\n"
        )

    def stop(self):
        """End all jobs and daemons that were started here, and put the configuration back."""
        subprocess.run(["scancel", "--user=root"], capture_output=True)
        for name in ("slurmd", "slurmctld"):
            with contextlib.suppress(
                FileNotFoundError, ValueError, psutil.NoSuchProcess, psutil.TimeoutExpired
            ):
                daemon = psutil.Process(int((self.folder / f"{name}.pid").read_text()))
                daemon.send_signal(signal.SIGTERM)
                daemon.wait(20)
        if getattr(self, "munge", None):
            self.munge.terminate()
            self.munge.wait(20)
        if self.saved.exists():
            shutil.rmtree(CONFIGURATION)
            shutil.copytree(self.saved, CONFIGURATION)


def wait_for(condition, seconds):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"the condition did not hold within {seconds} s")
        time.sleep(0.2)
