"""Simulators that are stepped from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from . import _biflag
from ._biflag import Robot
from ._errors import Error
from ._trial import Closure, Floats


@dataclass(frozen=True, eq=False)
class State:
    """State of a robot at one time. Units and axes are those of :class:`Trial`.

    >>> state = biflag.Simulator(biflag.Robot.physical()).state
    >>> state.time, state.yaw, state.attitude.tolist()
    (0.0, 0.0, [1.0, 0.0, 0.0, 0.0])
    """

    time: float
    yaw: float
    pitch: float
    roll: float
    attitude: Floats
    """Shape (4,)."""
    rates: Floats
    """Shape (3,)."""
    speeds: Floats
    """Shape (2,)."""
    turns: Floats
    """Shape (2,)."""
    forces: Floats
    """Shape (2, 3)."""
    torques: Floats
    """Shape (2,)."""
    gap: float
    """Distance of the flagella's surfaces now, m."""
    shapes: Floats
    """Shape (2, nodes, 3)."""


class Simulator:
    """A robot in its fluid that is advanced step by step, with speeds that are not known in advance.

    >>> simulator = biflag.Simulator(biflag.Robot.physical())
    >>> saved = simulator.save()
    >>> state = simulator.step((50, 10), 0.5)
    >>> state.time, state.yaw < 0
    (0.5, True)
    >>> simulator.restore(saved).time
    0.0

    Args:
        robot: The robot.
        closure: How the flagella act on the base.
        like_rig: Whether speeds take effect as with :class:`Rig`: 0.02 s later, by motors that fall behind the angle of a new
            target for 0.33 s and then make up for it. By default they are reached within 0.25 s.
    """

    def __init__(self, robot: Robot, *, closure: Closure = "full", like_rig: bool = False) -> None:
        self._simulators = _biflag.Simulators(robot, 1, closure, 1, like_rig)
        self.robot = robot
        """The robot."""

    def reset(self, seed: int | None = None) -> State:
        """Puts the robot back to rest at time 0, and returns its state.

        With a seed, the flagella start at random angles about their shafts, as on a rig; without one at those of the
        robot.
        """
        phase = start_phase(seed)
        self._simulators.reset(0, phase)
        return self.state

    def step(self, speeds: Sequence[float] | Floats, dt: float) -> State:
        """Advances by ``dt`` seconds and returns the state.

        Args:
            speeds: Speeds of motors 1 and 2 in rpm. The motors reach them within 0.25 s, or at the end of a shorter step;
                with ``like_rig`` as those of a rig.
            dt: Length in s, at most 60.

        Raises:
            ParameterError: An argument is impossible.
            Error: The solver fails; reset or restore the simulator.
        """
        _, failures = self._simulators.step(np.asarray(speeds)[np.newaxis], dt)
        if failures[0]:
            raise Error(failures[0], "solver", failures[0])
        return self.state

    def close(self) -> None:
        """Does nothing: only a rig has motors to stop."""

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def state(self) -> State:
        """The state now."""
        return State(**self._simulators.state(0))

    def save(self) -> bytes:
        """Returns all that the next steps depend on."""
        return self._simulators.save(0)

    def restore(self, saved: bytes) -> State:
        """Puts the robot back to what :meth:`save` returned, and returns its state.

        It goes on bit for bit, also in another process. A state of another robot, closure or ``like_rig`` is refused.
        """
        self._simulators.restore(0, saved)
        return self.state


def start_phase(seed: int | None) -> tuple[float, float]:
    """Returns the angles of both flagella at the start, degrees: zero without a seed."""
    if seed is None:
        return (0.0, 0.0)
    one, two = np.random.default_rng(seed).uniform(0.0, 360.0, 2)
    return (float(one), float(two))
