"""The outputs that notebooks are stored with, for those who read them without running them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_with_its_outputs(path: Path) -> None:
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1)), "run `make notebooks`"
    assert all(cell["outputs"] for cell in cells), "a cell shows nothing"
    assert any("image/png" in output.get("data", {}) for output in outputs) or path.stem == "4-fit"
    assert all(output["output_type"] != "error" for output in outputs)
    assert "/tmp" not in json.dumps(outputs)
