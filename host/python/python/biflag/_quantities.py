"""The quantities of a steady state, as the model lists them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class Quantities:
    """Quantities of a steady state."""

    yaw_deg: float
    """Steady yaw about the vertical, unwrapped, deg."""
    yaw_se_deg: float | None = None
    """Its standard error; ``None`` where it is unknown."""
    pitch_deg: float
    """Steady pitch about the y axis after the yaw, deg."""
    pitch_se_deg: float | None = None
    """Its standard error; ``None`` where it is unknown."""
    roll_deg: float
    """Steady roll about the x axis after yaw and pitch, deg."""
    roll_se_deg: float | None = None
    """Its standard error; ``None`` where it is unknown."""
    tilt_deg: float
    """Angle of the robot's axis to the vertical, from the steady pitch and roll of each phase, deg."""
    settle_s: float
    """Time from the start of the run after which yaw and pitch stay near their means; 0 if the steady state was solved for, s."""
    window_s: float
    """Length of the end of the run from which the means are taken, s."""
    force1_n: Floats
    """Force of flagellum 1 on the base, body axes, contact included, N."""
    force2_n: Floats
    """Force of flagellum 2 on the base, body axes, contact included, N."""
    force1_se_n: Floats | None = None
    """Its standard error; ``None`` where it is unknown."""
    force2_se_n: Floats | None = None
    """Its standard error; ``None`` where it is unknown."""
    thrust_n: float
    """Thrust of all flagella: their force on the base along z_B, N."""
    axial_torque_nm: Floats
    """Reaction torque of each flagellum on the base about its shaft, N m."""
    axial_torque_se_nm: Floats | None = None
    """Its standard error; ``None`` where it is unknown."""
    contact_share: float
    """Share of the time in which the flagella touch: of the period, or of the time that was averaged last, or of a trial."""
    min_gap_m: float
    """Least gap between the flagella's surfaces, negative if they overlap: of the run, of the period, or since the sample before, m."""
    power_w: float
    """Power at the shafts into the liquid, from the mean torques and the target speeds, W."""
    max_penetration_m: float
    """Largest overlap of the flagella's surfaces: of the run, of the period, or since the sample before, m."""
    simulated_s: float
    """Simulated time, the search for the steady state included, s."""
    sweeps: int
    """Sweeps of the solver."""
