"""A fast stand-in for the model: the map of steady states, and the way there.

Yaw, pitch and roll approach the steady values of the present speeds, each with one time constant. The map is that of the robot ``physical`` (:data:`biflag._biflag.STEADY_MAP`), bilinear between speeds 10 rpm apart. Left out: the
swing of the robot with each turn, the starting phase, and the bending of the flagella.
"""

from __future__ import annotations

import csv
import math

import numpy as np

from . import _biflag
from ._trial import Floats

STEP_RPM = 10.0
LARGEST_RPM = _biflag.MAX_SPEED_RPM

TIME_CONSTANTS_S = (1.5, 4.9, 4.9)
"""Of yaw, pitch and roll, fitted to the model."""


def steady_map() -> Floats:
    """Returns steady yaw, pitch and roll in degrees, shape (19, 19, 3), over the speeds -90 to 90 rpm of both flagella."""
    lines = [line for line in _biflag.STEADY_MAP.splitlines() if not line.startswith("#")]
    count = round(2 * LARGEST_RPM / STEP_RPM) + 1
    angles = np.full((count, count, 3), np.nan)
    for row in csv.DictReader(lines):
        one, two = (round((float(row[name]) + LARGEST_RPM) / STEP_RPM) for name in ("w1_rpm", "w2_rpm"))
        yaw, pitch, roll = (float(row[name]) for name in ("yaw_deg", "pitch_deg", "roll_deg"))
        # A robot of two equal flagella that exchange their speeds has the same yaw and the opposite pitch and roll.
        angles[two, one] = yaw, -pitch, -roll
        angles[one, two] = yaw, pitch, roll
    return angles


class FastRobots:
    """Robots that approach the steady attitude of their speeds, with the methods of ``_biflag.Simulators``."""

    def __init__(self, count: int) -> None:
        angles = steady_map()
        near, far = angles[:-1], angles[1:]
        # In each cell of the map: constant, along the first speed, along the second, along both.
        parts = (near[:, :-1], far[:, :-1] - near[:, :-1], near[:, 1:] - near[:, :-1])
        both = far[:, 1:] - far[:, :-1] - near[:, 1:] + near[:, :-1]
        self._cells: Floats = np.stack([*parts, both], axis=2)
        self.time_constants = np.array(TIME_CONSTANTS_S)
        self._shares: tuple[float, Floats] = (math.nan, np.zeros(3))
        self._poses = np.zeros((count, 6))
        self._basis = np.ones((count, 1, 4))
        self._no_failures = [""] * count

    def reset(self, index: int, _phase_deg: object = None) -> None:
        """Puts a robot back to rest. The starting phase does not matter."""
        self._poses[index] = 0.0

    def steady(self, speeds_rpm: Floats) -> Floats:
        """Returns the steady attitudes at speeds of shape (n, 2), shape (n, 3)."""
        at = (speeds_rpm + LARGEST_RPM) / STEP_RPM
        last = len(self._cells) - 1
        cell = np.minimum(np.maximum(at.astype(np.int64), 0), last)
        share = np.minimum(np.maximum(at - cell, 0.0), 1.0)
        self._basis[:, 0, 1:3] = share
        self._basis[:, 0, 3] = share[:, 0] * share[:, 1]
        steady: Floats = (self._basis @ self._cells[cell[:, 0], cell[:, 1]])[:, 0]
        return steady

    def step(self, speeds_rpm: Floats, dt: float) -> tuple[None, list[str]]:
        """Advances all robots by a time in s, at speeds of shape (n, 2). No robot fails."""
        _biflag.check_speeds(speeds_rpm)
        if self._shares[0] != dt:
            self._shares = (dt, -np.expm1(-dt / self.time_constants))
        angles, rates = self._poses[:, :3], self._poses[:, 3:]
        missing = self.steady(speeds_rpm) - angles
        way = self._shares[1] * missing
        angles += way
        # About body x, y and z: of roll, pitch and yaw.
        rates[:] = ((missing - way) / self.time_constants)[:, ::-1]
        return None, self._no_failures

    def poses(self) -> Floats:
        """Returns yaw, pitch and roll in degrees, and the rates about body x, y and z in degrees/s, shape (n, 6)."""
        return self._poses.copy()
