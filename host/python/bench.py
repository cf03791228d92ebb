"""Prints the speed of `simulate_batch` beside that of `biflag simulate`, and steps a second of the environments.

`make build && pip install './host/python[gym]' && python host/python/bench.py [STEP]`, with the step of the map in rpm, 10 for
the published one. The two run in turn, on all cores; their ratio is that of the sums.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import biflag
import biflag.gym
import gymnasium
import numpy as np

PROGRAM = Path(__file__).resolve().parents[2] / "target/release/biflag"
PLAN = """
[session]
name = "map"
robot = "published"
[trial]
calibrate = 0
preroll = 0
run = 120
decay = 0
[speeds]
grid = {{ w1 = [-90, 90, {step}], w2 = [0, 90, {step}] }}
"""


def spent(who: int) -> float:
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def program(plan: Path, out: Path) -> tuple[float, float]:
    """Returns the wall time and the processor time of the program, s."""
    begun, before = time.perf_counter(), spent(resource.RUSAGE_CHILDREN)
    command = [str(PROGRAM), "simulate", str(plan), "--out", str(out), "--json"]
    subprocess.run(command, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - begun, spent(resource.RUSAGE_CHILDREN) - before


def package(pairs: list[tuple[int, int]]) -> tuple[float, float]:
    begun, before = time.perf_counter(), spent(resource.RUSAGE_SELF)
    biflag.simulate_batch(biflag.Robot.published(), pairs, 120)
    return time.perf_counter() - begun, spent(resource.RUSAGE_SELF) - before


def batches(step: int) -> None:
    pairs = [(w1, w2) for w1 in range(-90, 91, step) for w2 in range(0, 91, step)]
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "map.toml"
        plan.write_text(PLAN.format(step=step))
        turns = [(program(plan, Path(folder) / str(i)), package(pairs)) for i in range(2)]
    wall, processor = np.array(turns).sum(axis=0).T
    print(f"{len(pairs)} trials of 120 s, twice: program {wall[0]:.1f} s, package {wall[1]:.1f} s of wall time;", end=" ")
    print(f"speed of the package over that of the program {wall[0] / wall[1]:.2f}", end=" ")
    print(f"({processor[0] / processor[1]:.2f} by processor time)")


def environments() -> None:
    for count in (1, 16, 128):
        environment = gymnasium.make_vec(
            "biflag/Attitude-v0", num_envs=count, vectorization_mode="vector_entry_point"
        )
        environment.reset(seed=1)
        environment.action_space.seed(1)
        steps = max(2, 128 // count)
        begun = time.perf_counter()
        for _ in range(steps):
            environment.step(environment.action_space.sample())
        rate = count * steps / (time.perf_counter() - begun)
        print(f"{count} environments: {rate:.0f} steps of half a second a second")


if __name__ == "__main__":
    environments()
    batches(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
