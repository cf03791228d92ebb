"""Fits the time constants of `biflag._fast` to the model, and prints its error on other speeds: `python host/python/fast.py`."""

import time

import biflag
import gymnasium
import numpy as np
from biflag._fast import FastRobots

ROBOT = biflag.Robot.physical()
STEP_S = 0.5
HELD = 40
"""Steps for which speeds are held."""


def trials(seed: int, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Speeds that change every 20 s, and the model's angles at the end of each step."""
    random = np.random.default_rng(seed)
    made = []
    for start in range(count):
        speeds = np.repeat(random.uniform(-90, 90, (4, 2)), HELD, axis=0)
        simulator = biflag.Simulator(ROBOT)
        simulator.reset(seed=start)
        states = [simulator.step(pair, STEP_S) for pair in speeds]
        made.append((speeds, np.array([(state.yaw, state.pitch, state.roll) for state in states])))
    return made


def fast(speeds: np.ndarray, time_constants: np.ndarray) -> np.ndarray:
    robots = FastRobots(1)
    robots.time_constants = time_constants
    angles = []
    for pair in speeds:
        robots.step(pair[np.newaxis], STEP_S)
        angles.append(robots.poses()[0, :3])
    return np.array(angles)


def error(made: list[tuple[np.ndarray, np.ndarray]], time_constants: np.ndarray) -> np.ndarray:
    return np.concatenate([fast(speeds, time_constants) - angles for speeds, angles in made])


def main() -> None:
    known = trials(seed=1, count=12)
    candidates = np.geomspace(0.5, 8, 29)
    errors = [(error(known, np.full(3, tau)) ** 2).mean(axis=0) for tau in candidates]
    best = candidates[np.argmin(errors, axis=0)]
    tilt = candidates[np.argmin([pitch + roll for _, pitch, roll in errors])]
    print(f"time constants: yaw {best[0]:.2f} s, pitch and roll {tilt:.2f} s")
    built_in = FastRobots(1).time_constants
    rest = np.abs(error(trials(seed=2, count=12), built_in))
    print(f"with {built_in[0]} s and {built_in[1]} s, on other speeds, degrees:")
    for k, name in enumerate(("yaw", "pitch", "roll")):
        rms, median, most = np.sqrt((rest[:, k] ** 2).mean()), np.median(rest[:, k]), np.percentile(rest[:, k], 95)
        print(f"{name}: RMS {rms:.1f}, median {median:.1f}, 95 % below {most:.1f}")
    import biflag.gym  # noqa: F401

    environment = gymnasium.make("biflag/AttitudeFast-v0", max_episode_steps=10**6)
    environment.reset(seed=1)
    action, count, begun = np.array([0.5, 0.1]), 20_000, time.perf_counter()
    for _ in range(count):
        environment.step(action)
    print(f"{count / (time.perf_counter() - begun):.0f} steps a second")


main()
