"""The rig, or the emulated board, stepped as a simulator is.

The program ``biflag steer`` does the work, with this process as its policy: a line of JSON with each observation, a line with
two speeds back. So the motors stop by the rules of that program, however this process ends, and the package needs no serial
port.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np

from ._errors import Error, ParameterError
from ._simulator import State
from ._trial import Floats

PERIOD_S = 0.05
"""Time from one observation to the next."""


class Rig:
    """The robot on the rig, with the interface of :class:`Simulator`.

    Args:
        port: The serial port of the board; ``None`` if only one board is plugged in.
        virtual: Whether to use the emulated board with the simulated robot instead. It waits for this process, so that two
            runs agree bit for bit.
        robot: The robot file, or the name of a built-in robot.
        rest: Duration of the rest before each run, s; 0 for none, and then no calibration of the gyroscope.
        longest: Longest time of a run, s. Then the motors stop.
        out: The folder of the sessions, one for each reset; by default a temporary one.
        program: The program ``biflag``; by default that on the ``PATH``.

    On a real rig each :meth:`step` must follow the one before within 0.4 s, or the motors stop and the next one fails. They
    also stop with :meth:`close`, at the end of a ``with`` block, and when this process ends in any way.
    """

    def __init__(
        self,
        port: str | None = None,
        *,
        virtual: bool = False,
        robot: str | os.PathLike[str] = "physical",
        rest: float = 20.0,
        longest: float = 3600.0,
        out: str | os.PathLike[str] | None = None,
        program: str | os.PathLike[str] | None = None,
    ) -> None:
        found = program or os.environ.get("BIFLAG_BIN") or shutil.which("biflag")
        if found is None:
            reason = "the program biflag is not on the PATH"
            raise ParameterError(f"program: {reason}", "program", reason)
        if virtual and port is not None:
            reason = "the emulated board has its own"
            raise ParameterError(f"port: {reason}", "port", reason)
        board = ["--virtual", "--lock-step"] if virtual else ["--port", port] if port is not None else []
        self._command = [os.fspath(found), "steer", "--yaw=0", "--pitch=0", "--policy", "-", "--json", *board]
        self._command += ["--robot", os.fspath(robot), "--rest", str(rest), "--for", str(longest)]
        self.out = Path(out if out is not None else tempfile.mkdtemp(prefix="biflag-rig-"))
        """The folder of the sessions."""
        self._process: subprocess.Popen[str] | None = None
        self._state: State | None = None
        self.log: Path | None = None
        """The log of the last run that has ended."""

    def reset(self, seed: int | None = None) -> State:
        """Ends the run, waits until the robot is still, and returns its state at the start of the next run.

        A rig cannot choose the angles of its flagella, so a seed changes nothing.
        """
        del seed
        self.close()
        self.out.mkdir(parents=True, exist_ok=True)
        number = 1 + sum(1 for _ in self.out.iterdir())
        command = [*self._command, "--out", str(self.out / f"run-{number:03}")]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        return self._observe()

    def step(self, speeds: Sequence[float] | Floats, dt: float) -> State:
        """Turns the flagella at these speeds for ``dt`` seconds and returns the state then.

        Args:
            speeds: Speeds of motors 1 and 2 in rpm.
            dt: Length in s, rounded to whole periods of 0.05 s.

        Raises:
            ParameterError: An argument is impossible. The motors are stopped.
            Error: The run has ended: the motors are stopped, and the log is kept.
        """
        pair = np.asarray(speeds, dtype=np.float64)
        periods = round(dt / PERIOD_S)
        if pair.shape != (2,) or not np.isfinite(pair).all() or periods < 1:
            self.close()
            key = "dt" if periods < 1 else "speeds"
            reason = f"is shorter than {PERIOD_S} s" if periods < 1 else "must be two finite speeds"
            raise ParameterError(f"{key}: {reason}", key, reason)
        reply = json.dumps({"speeds_rpm": pair.tolist()})
        state = self.state
        for _ in range(periods):
            self._write(reply)
            state = self._observe()
        return state

    @property
    def state(self) -> State:
        """The state at the last observation. What a rig does not measure is nan."""
        if self._state is None:
            reason = "reset it first"
            raise Error(reason, "rig", reason)
        return self._state

    def close(self) -> None:
        """Stops the motors, and waits until the log is complete."""
        process, self._process, self._state = self._process, None, None
        if process is None:
            return
        rest, _ = process.communicate(json.dumps({"end": True}) + "\n")
        self._take_answer(rest)

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def _write(self, line: str) -> None:
        input_ = self._pipe("stdin")
        try:
            input_.write(line + "\n")
            input_.flush()
        except BrokenPipeError:
            # Why is in its answer, which is read next.
            pass

    def _observe(self) -> State:
        line = self._pipe("stdout").readline()
        observed = json.loads(line) if line.strip() else {}
        if "time_s" not in observed:
            self._fail(line)
        self._state = state_of(observed)
        return self._state

    def _pipe(self, name: str) -> IO[str]:
        pipe: IO[str] | None = getattr(self._process, name, None)
        if pipe is None:
            reason = "reset it first"
            raise Error(reason, "rig", reason)
        return pipe

    def _fail(self, line: str) -> None:
        """Raises the error that the program ended with."""
        process, self._process, self._state = self._process, None, None
        rest, _ = process.communicate() if process is not None else ("", "")
        answer = self._take_answer(line + rest)
        reason = answer.get("error") or "the run has ended"
        raise Error(reason, "rig", reason)

    def _take_answer(self, text: str) -> dict[str, Any]:
        lines = [line for line in text.splitlines() if line.strip()]
        answer: dict[str, Any] = json.loads(lines[-1]) if lines else {}
        if answer.get("log"):
            self.log = Path(answer["log"])
        return answer


def state_of(observed: dict[str, Any]) -> State:
    """Returns the state of an observation."""
    yaw, pitch, roll = (observed[f"{angle}_deg"] for angle in ("yaw", "pitch", "roll"))
    return State(
        time=observed["time_s"],
        yaw=yaw,
        pitch=pitch,
        roll=roll,
        attitude=quaternion(yaw, pitch, roll),
        rates=np.array(observed["rates_dps"]),
        speeds=np.array(observed["speeds_rpm"]),
        turns=np.array(observed["turns"]),
        forces=np.full((2, 3), np.nan),
        torques=np.full(2, np.nan),
        gap=float("nan"),
        shapes=np.full((2, 0, 3), np.nan),
    )


def quaternion(yaw: float, pitch: float, roll: float) -> Floats:
    """Returns the rotation by yaw, then pitch, then roll (degrees) as w, x, y, z."""
    half = 0.5 * np.radians([yaw, pitch, roll])
    (cy, cp, cr), (sy, sp, sr) = np.cos(half), np.sin(half)
    parts: Floats = np.array(
        [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ]
    )
    return parts
