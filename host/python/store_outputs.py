"""Keeps the outputs of executed notebooks that a reader sees without running them: text, tables and pictures.

Pages of HTML, such as the robot in three dimensions, need scripts that viewers of notebooks do not run; their text stays.
"""

import json
import sys
from pathlib import Path

LARGEST_HTML = 20_000
"""Characters; the tables are below it."""

for path in map(Path, sys.argv[1:]):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell in notebook["cells"]:
        cell["metadata"] = {}
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if len("".join(data.get("text/html", ""))) > LARGEST_HTML:
                del data["text/html"]
    notebook["metadata"] = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
