"""Simulate a robot with two helical flagella, and read, compare and fit its trials.

>>> import biflag
>>> trial = biflag.simulate(biflag.Robot.published(), (50, 10), 120)
>>> abs(trial.steady.yaw_deg + 63.5) < 0.2
True

Angles are in degrees, speeds in rpm, all else is SI. `biflag.gym` has environments for gymnasium.
"""

from ._aim import Aimed, ContactChange, Doubt, Solution, aim
from ._biflag import MAX_SPEED_RPM, Figure, Robot, __commit__, __version__, figure
from ._errors import Error, ParameterError
from ._import import from_arrays
from ._recording import Angles, Event, Recording, Session, read_log, read_session
from ._rig import Rig
from ._simulator import Simulator, State
from ._sweep import read_sweep, sweep
from ._table import Table
from ._trial import Steady, Trial, simulate, simulate_batch
from ._twin import Calibration, ComparedTrial, Comparison, Estimate, calibrate, compare

__all__ = [
    "MAX_SPEED_RPM",
    "Aimed",
    "Angles",
    "Calibration",
    "ComparedTrial",
    "Comparison",
    "ContactChange",
    "Doubt",
    "Error",
    "Estimate",
    "Event",
    "Figure",
    "ParameterError",
    "Recording",
    "Rig",
    "Robot",
    "Session",
    "Simulator",
    "Solution",
    "State",
    "Steady",
    "Table",
    "Trial",
    "__commit__",
    "__version__",
    "aim",
    "calibrate",
    "compare",
    "figure",
    "from_arrays",
    "read_log",
    "read_session",
    "read_sweep",
    "simulate",
    "simulate_batch",
    "sweep",
]
