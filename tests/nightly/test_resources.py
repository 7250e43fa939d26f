"""Disks that are full or read-only, jobs without memory, files that are damaged."""

import os
import re
import shutil
import subprocess
from contextlib import suppress

import psutil
import pytest
from workflow_runs import CHUNKS, list_differences, mount, read_results


def test_a_full_disk_is_named_and_with_more_space_the_run_ends_as_undisturbed(
    start, finish, undisturbed, tmp_path
):
    expected, _ = undisturbed
    folder = tmp_path / "small"
    folder.mkdir()
    size = sum(map(len, expected.values()))
    for share in (0.25, 0.5, 0.75):
        with mount("-t", "tmpfs", "-o", f"size={int(share * size)}", "tmpfs", folder=folder):
            run = start(folder)
            assert run.wait() != 0
            assert "No space left on device" in run.text
            subprocess.run(["mount", "-o", f"remount,size={8 * size}", str(folder)], check=True)
            assert not list_differences(expected, finish(folder))


def test_a_read_only_folder_is_named(start, finish, undisturbed, tmp_path):
    expected, _ = undisturbed
    folder = tmp_path / "folder"
    folder.mkdir()
    with mount("--bind", str(folder), folder=folder):
        process = subprocess.run(
            ["mount", "-o", "remount,bind,ro", str(folder)], capture_output=True, text=True
        )
        if process.returncode:
            pytest.skip(f"this user may not mount a folder read-only: {process.stderr.strip()}")
        run = start(folder)
        assert run.wait() != 0
        assert "Read-only file system" in run.text
        assert str(folder) in run.text
    assert not list_differences(expected, finish(folder, unlock=False))


# The first job of `identify` runs out of memory where it is at work: its imports are done, and the compiled code of
# its methods is loaded. Then it may take no more address space, and all arrays of more than 64 kB need some.
LIMIT = """
import os, resource, sys

def limit_memory():
    import ankleloop_workflow.jobs.identification as module
    identify = module.identify

    def identify_without_memory(trial, *args, **options):
        identify(trial.trial, *args, **options)
        used = int(open("/proc/self/statm").read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (used, used))
        return identify(trial.trial, *args, **options)

    module.identify = identify_without_memory

if sys.orig_argv[-1].endswith(".identify.py"):
    try:
        os.close(os.open(os.environ["FIRST_JOB"], os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        pass
    else:
        limit_memory()
"""


def test_a_job_without_memory_says_so_and_the_others_finish(
    repository, start, finish, undisturbed, tmp_path
):
    """The message has study, point, trial and method, and the command that finishes the run."""
    expected, _ = undisturbed
    (tmp_path / "limit").mkdir()
    (tmp_path / "limit" / "sitecustomize.py").write_text(LIMIT, encoding="utf-8")
    folder = tmp_path / "work"
    folder.mkdir()
    path = os.pathsep.join([str(repository / "src"), str(tmp_path / "limit")])
    # Without the threshold arrays may come from memory that the job has freed, and has still.
    run = start(
        folder, PYTHONPATH=path, FIRST_JOB=str(tmp_path / "first"), MALLOC_MMAP_THRESHOLD_="65536"
    )
    assert run.wait() != 0
    assert (tmp_path / "first").exists()
    messages = re.findall(
        r"^rule identify.*out of memory.*", run.text.split("Logfile ")[0], re.MULTILINE
    )
    assert len(messages) == 1, run.text
    place = r"study study, point reflex_gain=\S+, trial \d+, method pr-moesp; results/trials/study/\d+\.nc"
    assert re.match(
        rf"rule identify, study study, chunk \d+; {place}: out of memory \(", messages[0]
    ), messages
    assert "run the same command again with fewer jobs at a time (--cores 1)" in messages[0]
    assert len(list(folder.glob("results/scores/study/*.parquet"))) == CHUNKS - 1
    assert not list(folder.rglob("*.part"))
    assert not list_differences(expected, finish(folder, unlock=False))


def kill_a_job(run):
    """Wait for a job of `identify`, and end it as the Linux kernel does for want of memory: by SIGKILL."""
    jobs = []

    def find_job():
        for process in psutil.Process(run.process.pid).children(recursive=True):
            with suppress(psutil.NoSuchProcess):
                if process.cmdline()[-1:] and process.cmdline()[-1].endswith(".identify.py"):
                    jobs.append(process)
        return jobs

    run.wait_for(find_job)
    jobs[0].kill()


def test_a_job_that_the_system_ends_is_named_and_the_others_are_not_repeated(
    start, finish, undisturbed, tmp_path
):
    run = start(tmp_path)
    kill_a_job(run)
    assert run.wait() != 0
    assert "Error in rule identify:" in run.text
    before = {path: path.stat().st_ino for path in tmp_path.glob("results/scores/study/*.parquet")}
    assert len(before) == CHUNKS - 1
    assert not list_differences(undisturbed[0], finish(tmp_path, unlock=False))
    assert all(path.stat().st_ino == number for path, number in before.items())


def test_a_killed_job_is_tried_again_with_twice_the_memory_and_time(start, undisturbed, tmp_path):
    run = start(tmp_path, "--retries", "1")
    kill_a_job(run)
    assert run.wait() == 0, run.text
    requests = {}
    pattern = r"^(?:local)?rule identify:\n.*?chunk=(\d+).*?mem_mb=(\d+),.*?runtime=(\d+)"
    for chunk, memory, minutes in re.findall(pattern, run.text, re.DOTALL | re.MULTILINE):
        requests.setdefault(chunk, []).append((int(memory), int(minutes)))
    assert len(requests) == CHUNKS
    ((memory, minutes), again) = max(requests.values(), key=len)
    assert again == (2 * memory, 2 * minutes)
    assert not list_differences(undisturbed[0], read_results(tmp_path))


DAMAGES = {
    "half": lambda content: content[: len(content) // 2],
    "empty": lambda content: b"",
    "other bytes": lambda content: content[:1000] + bytes(1000) + content[2000:],
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize(
    "file", ["trials/study/1.nc", "estimates/study/1.parquet", "scores/study/1.parquet"]
)
def test_a_damaged_file_is_named_and_deleting_it_mends_it(
    start, finish, undisturbed, unfinished, tmp_path, file, damage
):
    folder = tmp_path / "work"
    shutil.copytree(unfinished, folder)  # times of the files, too
    path = folder / "results" / file
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    run = start(folder)
    assert run.wait() != 0, (
        f"nobody noticed; different: {list_differences(undisturbed[0], read_results(folder))}"
    )
    logs = "".join(
        file.read_text(encoding="utf-8") for file in folder.glob("logs/*/study*") if file.is_file()
    )
    assert f"results/{file}" in run.text.split("Error in rule")[0] + logs
    path.unlink(missing_ok=True)
    assert not list_differences(undisturbed[0], finish(folder, unlock=False))
