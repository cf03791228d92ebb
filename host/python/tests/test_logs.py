"""What logs and sessions hold."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import biflag
import pytest
from conftest import biflag_json


def test_angles_are_those_of_the_commands(recorded: Path) -> None:
    session = biflag.read_session(recorded)
    assert list(session) == ["001_w1+50_w2+10"] and not session.missing and not session.incomplete
    for name, log in session.logs.items():
        theirs = biflag_json("info", str(log))["angles"]
        recording = session[name]
        assert recording.steady is not None and recording.complete and recording.origin == "emulated"
        for key in ("yaw_deg", "pitch_deg", "roll_deg", "yaw_uncertainty_deg", "drift_deg", "settled"):
            assert getattr(recording.steady, key) == theirs[key], key


def test_tables_are_those_of_the_export(recorded: Path, tmp_path: Path) -> None:
    biflag_json("export", str(recorded), "--format", "csv", "-o", str(tmp_path / "out"))

    def rows(name: str) -> list[dict[str, str]]:
        with open(tmp_path / "out" / name) as file:
            return list(csv.DictReader(line for line in file if not line.startswith("#")))

    session = biflag.read_session(recorded)
    table = session.table()
    for i, row in enumerate(rows("trials.csv")):
        assert row["trial"] == table["trial"][i]
        assert float(row["yaw_deg"]) == pytest.approx(table["yaw_deg"][i], abs=1e-9)
    recording = session["001_w1+50_w2+10"]
    theirs = rows("001_w1+50_w2+10.csv")
    assert len(theirs) == recording.table.rows
    names = ("time_s", "yaw_deg", "pitch_deg", "yaw_uncertainty_deg", "board_yaw_deg", "speed2_rpm")
    for name in (*names, "rate_z_dps", "gyro_x_counts", "truth_yaw_deg", "truth_turns2"):
        for row, value in zip(theirs, recording.table[name], strict=True):
            assert math.isnan(value) if row[name] == "" else abs(float(row[name]) - value) < 1e-9, name
    assert [row["phase"] for row in theirs] == recording.table["phase"].tolist()


def test_a_recording_tells_what_happened(recorded: Path) -> None:
    recording = biflag.read_session(recorded)["001_w1+50_w2+10"]
    assert recording.speeds_rpm == (50, 10) and recording.phases["run"][0] == 0
    assert recording.phases["run"][1] == pytest.approx(24, abs=0.1)
    phases = [event.text for event in recording.events if event.kind == "phase"]
    assert phases[:4] == ["wait", "calibrate", "preroll", "run"]
    assert recording.link["samples"] > 8_000 and recording.link["lost"] == 0
    assert recording.records["plan"]["name"] == "tank" and recording.robot is not None
    assert recording.robot["fluid.viscosity_pa_s"] == 0.8
    assert recording._repr_html_().startswith("<iframe srcdoc=")


def test_other_files_are_refused(recorded: Path, tmp_path: Path) -> None:
    text = tmp_path / "notes.mcap"
    text.write_text("no log")
    for path, read in ((text, biflag.read_log), (tmp_path / "none", biflag.read_log), (tmp_path, biflag.read_session)):
        with pytest.raises(biflag.Error) as caught:
            read(path)
        assert str(path) in str(caught.value) and caught.value.key == str(path)


def test_a_log_that_is_cut_off_is_read_with_a_warning(recorded: Path, tmp_path: Path) -> None:
    log = next(iter(biflag.read_session(recorded).logs.values()))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[:-200_000])
    recording = biflag.read_log(cut)
    assert not recording.complete and any("cut off" in warning for warning in recording.warnings)
    assert recording.table.rows > 1000
