"""The compiled part of the package."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "MAX_SPEED_RPM",
    "STEADY_MAP",
    "Answer",
    "Figure",
    "Robot",
    "Simulated",
    "Simulators",
    "__commit__",
    "__version__",
    "aim",
    "calibrate",
    "check_speeds",
    "compare",
    "ending",
    "figure",
    "html",
    "picture",
    "read_log",
    "read_session",
    "read_sweep",
    "session_repeats",
    "session_table",
    "simulate",
    "simulate_batch",
    "sweep",
    "write_states",
]

__version__: str
__commit__: str
STEADY_MAP: str
MAX_SPEED_RPM: float

@final
class Robot:
    """Parameters of a robot, its fluid and the solver, by the keys of a robot file, SI. It never changes."""

    @staticmethod
    def published() -> Robot: ...
    @staticmethod
    def physical() -> Robot: ...
    @staticmethod
    def load(path: str | PathLike[str]) -> Robot: ...
    @staticmethod
    def from_toml(text: str) -> Robot: ...
    def replace(self, changes: Mapping[str, Any]) -> Robot: ...
    def to_toml(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...
    @staticmethod
    def keys() -> dict[str, str]: ...
    def time_constants(self) -> tuple[float, float]: ...
    @property
    def name(self) -> str: ...
    def __getitem__(self, key: str, /) -> Any: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    @staticmethod
    def _of_file(name: str, text: str) -> Robot: ...

@final
class Simulated:
    def arrays(self) -> dict[str, NDArray[Any]]: ...
    def columns(self) -> dict[str, NDArray[Any]]: ...
    def steady(self) -> dict[str, Any]: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def html(self) -> str: ...

@final
class Figure:
    @property
    def svg(self) -> str: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def _repr_svg_(self) -> str: ...

@final
class Answer:
    def record(self) -> dict[str, Any]: ...
    def target(self) -> str: ...
    def save_plan(self, path: str | PathLike[str]) -> None: ...

@final
class Simulators:
    def __new__(cls, robot: Robot, count: int, closure: str, threads: int | None, rig: bool) -> Simulators: ...
    @property
    def robot(self) -> Robot: ...
    def reset(self, index: int, phase_deg: Sequence[float]) -> None: ...
    def step(self, speeds: ArrayLike, dt: float) -> tuple[NDArray[np.float64], list[str]]: ...
    def poses(self) -> NDArray[np.float64]: ...
    def state(self, index: int) -> dict[str, Any]: ...
    def save(self, index: int) -> bytes: ...
    def restore(self, index: int, saved: bytes) -> None: ...

def simulate(
    robot: Robot,
    speeds: object,
    duration: float | None,
    closure: str,
    method: str,
    rate_hz: float,
    shapes: bool,
    phase_deg: Sequence[float],
) -> Simulated: ...
def check_speeds(speeds: ArrayLike) -> None: ...
def ending(path: str | PathLike[str], endings: list[str]) -> int: ...
def simulate_batch(
    robots: Sequence[Robot],
    speeds: ArrayLike,
    duration: float,
    closure: str,
    method: str,
    rate_hz: float,
    phase_deg: Sequence[float],
    threads: int | None,
    progress: Callable[[int, int], object] | None,
) -> dict[str, Any]: ...
def read_log(path: str | PathLike[str]) -> dict[str, Any]: ...
def read_session(path: str | PathLike[str]) -> dict[str, Any]: ...
def session_repeats(path: str | PathLike[str]) -> list[dict[str, Any]]: ...
def session_table(path: str | PathLike[str]) -> tuple[dict[str, Any], list[tuple[str, str]]]: ...
def html(path: str | PathLike[str]) -> str: ...
def figure(subject: str, *sources: object, width_mm: float | None = None, **options: object) -> Figure: ...
def picture(
    robot: Robot,
    angles_deg: Sequence[float],
    shapes: NDArray[np.float64] | None,
    width: int,
) -> NDArray[np.uint8]: ...
def compare(
    measured: str | PathLike[str],
    modelled: str | PathLike[str] | None,
    robot: Robot | None,
    closure: str | None,
    anyway: bool,
    jobs: int | None,
) -> tuple[dict[str, Any], dict[str, dict[str, NDArray[Any]]]]: ...
def calibrate(
    logs: Sequence[str | PathLike[str]],
    fit: Sequence[str],
    robot: Robot | None,
    closure: str | None,
    jobs: int | None,
) -> tuple[dict[str, Any], Robot, str]: ...
def aim(
    robot: Robot,
    yaw: float | None,
    pitch: float | None,
    roll: float | None,
    tilt: float | None,
    thrust: float | None,
    table: str | PathLike[str] | Sequence[tuple[str, Sequence[float]]] | None,
    seconds: float,
    threads: int | None,
) -> Answer: ...
def sweep(
    plan: str | PathLike[str],
    out: str | PathLike[str],
    threads: int | None,
    progress: Callable[[int, int], object] | None,
) -> tuple[dict[str, Any], list[tuple[str, str]], list[str]]: ...
def read_sweep(path: str | PathLike[str]) -> tuple[dict[str, Any], list[tuple[str, str]], list[str]]: ...
def write_states(
    path: str | PathLike[str],
    rows: NDArray[np.float64],
    motion: str | None,
    robot: Robot,
    known: Mapping[str, Any],
) -> None: ...
