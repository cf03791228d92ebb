"""Environments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

import biflag  # noqa: E402
import biflag.gym  # noqa: E402
from conftest import PROGRAM  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

NAME = "biflag/Attitude-v0"


def many(count: int, **options: Any) -> Any:
    return gymnasium.make_vec(NAME, num_envs=count, vectorization_mode="vector_entry_point", **options)


def test_environment_passes_the_checks_of_gymnasium() -> None:
    check_env(gymnasium.make(NAME).unwrapped)


def test_vector_environment_is_many_single_ones() -> None:
    together, options = many(3, threads=2), {"attitude": (40.0, 3.0)}
    observations, _ = together.reset(seed=5, options=options)
    alone = [gymnasium.make(NAME) for _ in range(3)]
    for i, environment in enumerate(alone):
        environment.reset(seed=5 + i, options=options)
    together.action_space.seed(1)
    for _ in range(4):
        actions = together.action_space.sample()
        observations, rewards, ended, truncated, info = together.step(actions)
        for i, environment in enumerate(alone):
            observation, reward, *_ = environment.step(actions[i])
            assert observation.tolist() == observations[i].tolist() and reward == rewards[i]
        assert not ended.any() and not truncated.any() and (info["error_deg"] == -rewards).all()


def test_an_episode_that_has_ended_starts_anew() -> None:
    environment = many(2, max_episode_steps=2)
    first, _ = environment.reset(seed=1)
    forward = np.full((2, 2), 0.5)
    assert not environment.step(forward)[3].any()
    assert environment.step(forward)[3].all()
    observations, rewards, ended, truncated, _ = environment.step(forward)
    assert (observations[:, :6] == 0).all() and (rewards == 0).all() and not ended.any() and not truncated.any()
    assert (observations[:, 6:] != first[:, 6:]).any(), "another attitude is wanted"
    with pytest.raises(biflag.ParameterError, match="attitude"):
        environment.reset(options={"attitude": "up"})


def test_a_reset_after_an_episode_begins_at_once() -> None:
    environment = many(2, max_episode_steps=2)
    environment.reset(seed=1)
    forward = np.full((2, 2), 0.5)
    first = environment.step(forward)[0]
    assert environment.step(forward)[3].all()
    environment.reset(seed=1)
    assert np.array_equal(environment.step(forward)[0], first)


def test_a_solver_that_fails_ends_the_episode() -> None:
    fragile = biflag.Robot.physical().replace({"solver.halvings": 0, "solver.sweeps": 2})
    environment = gymnasium.make(NAME, robot=fragile)
    environment.reset(seed=1)
    _, reward, ended, _, info = environment.step(np.ones(2))
    assert ended and reward == -180 and "no step" in info["failure"]


@pytest.mark.parametrize("name", [NAME, "biflag/AttitudeFast-v0"])
def test_speeds_beyond_the_limit_are_refused(name: str) -> None:
    environment = gymnasium.make(name, disable_env_checker=True)
    environment.reset(seed=1)
    with pytest.raises(biflag.ParameterError, match="180 rpm is beyond ±90 rpm"):
        environment.step(np.array([2.0, 0.0]))


def test_integral_control_holds_an_attitude() -> None:
    """A sensitivity that is measured in the model once, and integration of the error."""
    robot, wanted, step = biflag.Robot.physical(), np.array([40.0, 3.0]), 8.0
    near = np.array([-40.0, 10.0])
    table = biflag.simulate_batch(robot, near + step * np.array([[0, 0], [1, 0], [0, 1]]), 40)
    angles = np.column_stack([table["yaw_deg"], table["pitch_deg"]])
    sensitivity = (angles[1:] - angles[0]).T / step
    inverse = np.linalg.inv(sensitivity)
    environment = gymnasium.make(NAME)
    observation, _ = environment.reset(seed=0, options={"attitude": tuple(wanted)})
    speeds, seen = near + inverse @ (wanted - angles[0]), []
    for _ in range(240):
        speeds = np.clip(speeds + 0.02 * inverse @ (wanted - observation[:2]), -90, 90)
        observation, *_ = environment.step(speeds / 90)
        seen.append(observation[:2])
    # Means over 12 s, as steady values are, from the first minute on.
    means = np.array([np.mean(seen[i : i + 24], axis=0) for i in range(120, 240 - 24 + 1)])
    worst = np.abs(means - wanted).max(axis=0)
    print(f"from 60 s on, means over 12 s are within {worst[0]:.2f} deg of the yaw and {worst[1]:.2f} deg of the pitch")
    assert worst.max() < 1.0


def test_fast_environment_is_near_the_model() -> None:
    environment = gymnasium.make("biflag/AttitudeFast-v0")
    check_env(environment.unwrapped)
    full = gymnasium.make(NAME)
    random = np.random.default_rng(5)
    differences = []
    for episode in range(2):
        for one in (environment, full):
            one.reset(seed=episode)
        for _ in range(3):
            action = random.uniform(-1, 1, 2)
            for _ in range(40):
                fast, slow = environment.step(action)[0], full.step(action)[0]
                differences.append(fast[:3] - slow[:3])
    rms = np.sqrt((np.array(differences) ** 2).mean(axis=0))
    print("fast against full, RMS yaw, pitch, roll:", rms)
    # The swing with each turn, which it leaves out, has some degrees of tilt.
    assert rms[0] < 20 and rms[1] < 6 and rms[2] < 8, rms
    with pytest.raises(biflag.ParameterError, match="fast"):
        gymnasium.make("biflag/AttitudeFast-v0", robot=biflag.Robot.published())


def test_a_rendered_robot_turns() -> None:
    environment = gymnasium.make(NAME, render_mode="rgb_array")
    environment.reset(seed=1)
    upright = environment.render()
    for _ in range(20):
        environment.step(np.array([0.8, 0.8]))
    turned = environment.render()
    assert isinstance(upright, np.ndarray) and isinstance(turned, np.ndarray)
    assert upright.shape == (480, 360, 3) and upright.dtype == np.uint8
    assert (np.abs(upright.astype(int) - turned.astype(int)) > 60).sum() > 1000


def test_environment_runs_on_the_emulated_board(tmp_path: Path) -> None:
    environment = gymnasium.make(NAME, on="virtual", rest=0.0, out=tmp_path, program=PROGRAM)
    observation, _ = environment.reset(options={"attitude": (-40.0, -2.0)})
    assert observation[6:].tolist() == [-40.0, -2.0]
    observation, reward, terminated, _, info = environment.step(np.array([0.5, 0.2]))
    assert observation[0] < -1.0 and reward == -info["error_deg"] and not terminated
    environment.close()
    assert list(tmp_path.glob("run-001/*.mcap"))
