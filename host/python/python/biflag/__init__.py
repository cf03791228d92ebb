"""Simulate a robot with two helical flagella, and read, compare and fit its trials.

>>> import biflag
>>> trial = biflag.simulate(biflag.Robot.published(), (50, 10), 120)
>>> trial.steady.yaw_deg
"""

from ._biflag import Robot, __commit__, __version__
from ._errors import Error, ParameterError
from ._simulator import Simulator, State
from ._table import Table
from ._trial import Steady, Trial, simulate, simulate_batch

__all__ = [
    "Error",
    "ParameterError",
    "Robot",
    "Simulator",
    "State",
    "Steady",
    "Table",
    "Trial",
    "__commit__",
    "__version__",
    "simulate",
    "simulate_batch",
]
