"""Environments for gymnasium: reach an attitude and hold it.

>>> import gymnasium
>>> import biflag.gym
>>> environment = gymnasium.make("biflag/Attitude-v0")
>>> many = gymnasium.make_vec("biflag/Attitude-v0", num_envs=16, vectorization_mode="vector_entry_point")

The second one computes its robots side by side on all cores. ``biflag/AttitudeFast-v0`` has the same spaces and a fast
stand-in for the model, the map of steady states with the way there (``biflag/_fast.py``): for what a policy learns first.
With ``on="virtual"`` or ``on="rig"`` the first one runs on the emulated board or on the rig (:class:`biflag.Rig`), whose
flagella start wherever they are. With ``render_mode="rgb_array"``, ``render()`` returns a picture of the robot.

A step lasts half a second. The action has the speeds of motors 1 and 2, from -1 to 1 times 90 rpm. The observation has yaw, pitch and roll in degrees,
the angular velocity in body axes in degrees/s, and the wanted yaw and pitch. The reward is the negative error in degrees,
the larger one of yaw and pitch. A new episode starts upright and at rest, with flagella at random angles; its wanted attitude
is near one that random speeds give, unless ``options={"attitude": (yaw, pitch)}`` names another. An episode ends after 240
steps, or if the solver fails, which ``info["failure"]`` then says.

The robot swings by some degrees with each turn of its flagella, at any speeds. What can be held is the mean over some turns.

The model stands for a rig: speeds take effect after its delay, by motors like its own (``like_rig`` of
:class:`biflag.Simulator`). ``like_rig=False`` turns this off.
"""

from __future__ import annotations

from typing import Any, Literal, cast

import gymnasium
import numpy as np
from gymnasium import Space
from gymnasium.envs.registration import register
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import _biflag
from ._biflag import Robot
from ._errors import Error, ParameterError
from ._fast import FastRobots
from ._rig import Rig
from ._simulator import State
from ._trial import Closure, Floats

__all__ = ["AttitudeEnv", "AttitudeVectorEnv"]

MAX_SPEED_RPM = _biflag.MAX_SPEED_RPM

MAX_STEPS = 240

LIMITS = np.array([7200.0, 90.0, 180.0, 3600.0, 3600.0, 3600.0, 7200.0, 90.0])
"""Largest observations; a yaw beyond 20 turns stays there."""

WANTED_SPEED_RPM = 60.0

YAW_PER_RPM = -1.0
"""Steady yaw over the sum of both speeds, about, degrees."""

PITCH_PER_RPM = -0.09
"""Steady pitch over the difference of both speeds, about, degrees."""

FAILED_REWARD = -180.0


class AttitudeEnv(gymnasium.Env[Floats, Floats]):
    """One robot that is to reach an attitude and to hold it."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}

    def __init__(
        self,
        robot: Robot | None = None,
        *,
        closure: Closure = "full",
        dt: float = 0.5,
        fast: bool = False,
        like_rig: bool = True,
        on: Literal["simulator", "virtual", "rig"] = "simulator",
        render_mode: str | None = None,
        **rig: Any,
    ) -> None:
        """Without arguments the robot is computed; ``rig`` has those of :class:`biflag.Rig`, such as its port."""
        if render_mode not in (None, "rgb_array"):
            reason = f'{render_mode!r} is not "rgb_array"'
            raise ParameterError(f"render_mode: {reason}", "render_mode", reason)
        self.render_mode = render_mode
        self.observation_space = observation_space()
        self.action_space = action_space()
        self.dt = dt
        self._robot = robot or Robot.physical()
        self._body: Simulated | Rigged
        if on == "simulator":
            self._body = Simulated(simulators(robot, 1, closure, 1, fast, like_rig))
        else:
            self._body = Rigged(Rig(virtual=on == "virtual", **rig))
        self._wanted = np.zeros(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        super().reset(seed=seed)
        self._wanted = wanted(self.np_random, options)
        self._body.reset(random_phase(self.np_random))
        return self._observed(), {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        failure = self._body.step(speeds_rpm(action), self.dt)
        observation = self._observed()
        error = float(errors(observation))
        info: dict[str, Any] = {"error_deg": error}
        if failure:
            info["failure"] = failure
            return observation, FAILED_REWARD, True, False, info
        return observation, -error, False, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Returns a picture of the robot, shape (480, 360, 3); ``None`` unless ``render_mode`` is "rgb_array"."""
        if self.render_mode is None:
            return None
        yaw, pitch, roll = self._body.pose()[0, :3].tolist()
        return _biflag.picture(self._robot, (yaw, pitch, roll), self._body.shapes(), 360)

    def close(self) -> None:
        self._body.close()

    def _observed(self) -> Floats:
        observed: Floats = observations(self._body.pose(), self._wanted[np.newaxis])[0]
        return observed


class Simulated:
    """A robot that is computed."""

    def __init__(self, simulators: _biflag.Simulators | FastRobots) -> None:
        self._simulators = simulators

    def reset(self, phase: tuple[float, float]) -> None:
        self._simulators.reset(0, phase)

    def step(self, speeds: Floats, dt: float) -> str:
        """Returns why the solver failed; empty where it did not."""
        _, failures = self._simulators.step(speeds[np.newaxis], dt)
        return failures[0]

    def pose(self) -> Floats:
        poses: Floats = self._simulators.poses()
        return poses

    def shapes(self) -> Floats | None:
        """Returns the centre lines of the flagella; ``None`` where they are not computed."""
        return None if isinstance(self._simulators, FastRobots) else self._simulators.state(0)["shapes"]

    def close(self) -> None:
        pass


class Rigged:
    """The robot on the rig, or on the emulated board."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._pose: Floats = np.zeros((1, 6))

    def reset(self, phase: tuple[float, float]) -> None:
        # A rig cannot choose the angles of its flagella.
        del phase
        self._see(self._rig.reset())

    def step(self, speeds: Floats, dt: float) -> str:
        """Returns why the run has ended; empty while it goes on."""
        try:
            self._see(self._rig.step(speeds, dt))
        except Error as error:
            return error.reason or str(error)
        return ""

    def pose(self) -> Floats:
        return self._pose

    def shapes(self) -> Floats | None:
        """A rig does not know the shapes."""
        return None

    def close(self) -> None:
        self._rig.close()

    def _see(self, state: State) -> None:
        self._pose = np.array([[state.yaw, state.pitch, state.roll, *state.rates]])


class AttitudeVectorEnv(VectorEnv[Floats, Floats, Floats]):
    """Robots that are computed side by side. An episode that has ended starts anew with the next step."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int = MAX_STEPS,
        robot: Robot | None = None,
        *,
        closure: Closure = "full",
        dt: float = 0.5,
        threads: int | None = None,
        fast: bool = False,
        like_rig: bool = True,
    ) -> None:
        self.num_envs = num_envs
        self.single_observation_space = observation_space()
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.dt = dt
        self.max_episode_steps = max_episode_steps
        self._simulators = simulators(robot, num_envs, closure, threads, fast, like_rig)
        self._wanted = np.zeros((num_envs, 2))
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=np.bool_)
        self._randoms = [np.random.default_rng() for _ in range(num_envs)]
        self._options: dict[str, Any] | None = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        if seed is not None:
            seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
            self._randoms = [np.random.default_rng(one) for one in seeds]
        self._options = options
        self._ended[:] = False
        for i in range(self.num_envs):
            self._begin(i)
        return self._observed(), {}

    def step(self, actions: Floats) -> tuple[Floats, Floats, Any, Any, dict[str, Any]]:
        begun = self._ended.copy()
        # A robot at rest that starts anew does not move in this step.
        speeds = np.where(begun[:, np.newaxis], 0.0, speeds_rpm(actions))
        _, failures = self._simulators.step(speeds, self.dt)
        for i in np.flatnonzero(begun):
            self._begin(int(i))
        observation = self._observed()
        error = errors(observation)
        failed = np.array([bool(failure) for failure in failures]) & ~begun
        self._steps[~begun] += 1
        truncated = (self._steps >= self.max_episode_steps) & ~begun & ~failed
        reward = np.where(begun, 0.0, np.where(failed, FAILED_REWARD, -error))
        self._ended = failed | truncated
        info: dict[str, Any] = {"error_deg": error}
        if failed.any():
            info["failure"] = np.array(failures, dtype=object)
            info["_failure"] = failed
        return observation, reward, failed, truncated, info

    def _begin(self, i: int) -> None:
        self._wanted[i] = wanted(self._randoms[i], self._options)
        self._simulators.reset(i, random_phase(self._randoms[i]))
        self._steps[i] = 0

    def _observed(self) -> Floats:
        return observations(self._simulators.poses(), self._wanted)


def simulators(
    robot: Robot | None, count: int, closure: Closure, threads: int | None, fast: bool, like_rig: bool
) -> _biflag.Simulators | FastRobots:
    if not fast:
        return _biflag.Simulators(robot or Robot.physical(), count, closure, threads, like_rig)
    if closure != "full" or (robot is not None and robot != Robot.physical()):
        reason = "the fast environment has the robot `physical` with the closure `full` only"
        raise ParameterError(f"fast: {reason}", "fast", reason)
    return FastRobots(count)


def observation_space() -> Space[Floats]:
    return cast("Space[Floats]", Box(-LIMITS, LIMITS, dtype=np.float64))


def action_space() -> Space[Floats]:
    return cast("Space[Floats]", Box(-1.0, 1.0, (2,), dtype=np.float64))


def speeds_rpm(actions: Floats) -> Floats:
    return MAX_SPEED_RPM * np.asarray(actions, dtype=np.float64)


def observations(poses: Floats, wanted: Floats) -> Floats:
    observed: Floats = np.minimum(np.maximum(np.concatenate([poses, wanted], axis=1), -LIMITS), LIMITS)
    return observed


def errors(observation: Floats) -> Floats:
    """Returns the larger error of yaw and pitch, degrees."""
    largest: Floats = np.abs(observation[..., :2] - observation[..., 6:8]).max(axis=-1)
    return largest


def wanted(random: np.random.Generator, options: dict[str, Any] | None) -> Floats:
    """Returns the wanted yaw and pitch, degrees."""
    if options is not None and "attitude" in options:
        reason = f"{options['attitude']!r} is not a yaw and a pitch in degrees"
        try:
            attitude = np.asarray(options["attitude"], dtype=np.float64)
        except ValueError:
            attitude = np.full(2, np.nan)
        if attitude.shape != (2,) or not np.isfinite(attitude).all():
            raise ParameterError(f"attitude: {reason}", "attitude", reason)
        return attitude
    one, two = random.uniform(-WANTED_SPEED_RPM, WANTED_SPEED_RPM, 2)
    return np.array([YAW_PER_RPM * (one + two), PITCH_PER_RPM * (one - two)])


def random_phase(random: np.random.Generator) -> tuple[float, float]:
    one, two = random.uniform(0.0, 360.0, 2)
    return (float(one), float(two))


register(
    id="biflag/Attitude-v0",
    entry_point="biflag.gym:AttitudeEnv",
    vector_entry_point="biflag.gym:AttitudeVectorEnv",
    max_episode_steps=MAX_STEPS,
)
register(
    id="biflag/AttitudeFast-v0",
    entry_point="biflag.gym:AttitudeEnv",
    vector_entry_point="biflag.gym:AttitudeVectorEnv",
    max_episode_steps=MAX_STEPS,
    kwargs={"fast": True},
)
