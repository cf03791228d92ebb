"""Use in a process that was forked off one that has used the package: what multiprocessing does on Linux up to Python 3.13."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import os, sys
import biflag, numpy

robots = biflag._biflag.Simulators(biflag.Robot.physical(), 2, "full", 2, False)

def work():
    poses, failures = robots.step(numpy.array([[50, 10], [10, 50]]), 0.1)
    session = biflag.read_session(sys.argv[1])
    batch = biflag.simulate_batch(biflag.Robot.physical(), [(50, 10)], 1)
    rows = session.table().rows, len(biflag.compare(sys.argv[1]).trials), batch.rows
    return rows, poses.shape[0], [failure for failure in failures if failure]

here = work()
child = os.fork()
if child == 0:
    os._exit(0 if work() == here == ((1, 1, 1), 2, []) else 1)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_a_forked_process_has_threads(recorded: Path) -> None:
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, str(recorded)]
    subprocess.run(command, check=True, timeout=60)
