"""Parameters of robots."""

from __future__ import annotations

import pickle
from pathlib import Path

import biflag
import pytest


def test_built_in_robots_are_those_of_the_program() -> None:
    published, physical = biflag.Robot.published(), biflag.Robot.physical()
    assert published["joint.tether_full_nm_per_rad"] == 3.599e-4
    assert physical["joint.tether_full_nm_per_rad"] == 5.006e-4
    assert physical["fluid"]["viscosity_pa_s"] == 1.0
    assert published != physical and published == biflag.Robot.published()
    assert (published.name, biflag.Robot.load("physical")) == ("published", physical)


def test_replace_changes_only_what_it_names() -> None:
    robot = biflag.Robot.physical()
    changed = robot.replace({"fluid.viscosity_pa_s": 0.8, "flagellum.handedness": ["left", "right"]})
    assert robot["fluid.viscosity_pa_s"] == 1.0
    assert changed["fluid.viscosity_pa_s"] == 0.8
    assert changed["flagellum.handedness"] == ["left", "right"]
    back = {"fluid.viscosity_pa_s": 1, "flagellum.handedness": ["right", "right"]}
    assert changed.replace(back) == robot and hash(changed.replace(back)) == hash(robot)


def test_optional_tables_come_and_go() -> None:
    robot = biflag.Robot.physical()
    glycerol = robot.replace({"fluid.glycerol": {"mass_fraction": 0.99, "temperature_c": 20.0}})
    assert glycerol["fluid.glycerol.temperature_c"] == 20.0
    assert glycerol == robot.replace({"fluid.glycerol.mass_fraction": 0.99, "fluid.glycerol.temperature_c": 20})
    assert glycerol.replace({"fluid.glycerol": None}) == robot


@pytest.mark.parametrize("kept", [pickle.dumps, biflag.Robot.to_toml])
def test_robots_survive_storage_to_the_last_bit(kept: object) -> None:
    changed = biflag.Robot.published().replace({"fluid.viscosity_pa_s": 0.1 + 0.2})
    for robot in (biflag.Robot.physical(), biflag.Robot.published(), changed):
        again = pickle.loads(pickle.dumps(robot)) if kept is pickle.dumps else biflag.Robot.from_toml(robot.to_toml())
        assert again == robot


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("fluid.viscosity_pa_s", -1, "must be between"),
        ("fluid.viscosity_pa_s", "thick", "invalid type"),
        ("fluid.viscosity", 1, "unknown field `viscosity`"),
        ("water.viscosity_pa_s", 1, "unknown field `water`"),
        ("fluid.viscosity_pa_s.of", 1, "is not a table"),
        ("base.motor_distance_m", 0.01, "the flagella touch"),
        ("fluid.viscosity_pa_s", float("nan"), "must be between"),
        ("fluid.viscosity_pa_s", object(), "is not a value"),
    ],
)
def test_impossible_values_are_named_with_the_reason(key: str, value: object, reason: str) -> None:
    with pytest.raises(ValueError, match=key) as caught:
        biflag.Robot.physical().replace({"base.mass_kg": 0.1, key: value})
    assert isinstance(caught.value, biflag.ParameterError)
    assert caught.value.key == key and reason in caught.value.reason


def test_files_are_read_with_the_place_of_a_mistake(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text("[fluid]\nviscosity_pa_s = 0.8\n")
    assert biflag.Robot.load(file) == biflag.Robot.physical().replace({"fluid.viscosity_pa_s": 0.8})
    file.write_text("[fluid]\nviscosity_pa_s = -2\n")
    with pytest.raises(biflag.ParameterError, match="robot.toml:2:18: fluid.viscosity_pa_s = -2") as caught:
        biflag.Robot.load(file)
    assert caught.value.help
    with pytest.raises(biflag.ParameterError, match="cannot be read"):
        biflag.Robot.load(tmp_path / "none.toml")
    with pytest.raises(KeyError, match=r"fluid\.colour"):
        biflag.Robot.physical()["fluid.colour"]
