"""Prints the licence texts of all crates of other authors that are inside a package's program.

Usage: libraries.py [--target TRIPLE] PACKAGE...
"""

import json
import subprocess
import sys
from pathlib import Path

NAMES = ("license", "licence", "copying", "notice", "copyright", "unlicense")


def cargo(*arguments: str) -> str:
    return subprocess.run(["cargo", *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


def main(packages: list[str]) -> None:
    metadata = json.loads(cargo("metadata", "--format-version", "1", "--locked"))
    crates = {f"{crate['name']} {crate['version']}": crate for crate in metadata["packages"]}
    own: list[str] = []
    if packages[0] == "--target":
        own, packages = packages[:2], packages[2:]
    names: set[str] = set()
    for package in packages:
        # The firmware is inside biflag, and is no program of this computer.
        target = ["--target", "all"] if package == "firmware" else own
        format = ["--edges", "normal", "--prefix", "none", "--format", "{p}"]
        tree = cargo("tree", "--locked", *format, "--package", package, *target)
        names |= {" ".join(line.split()[:2]).replace(" v", " ") for line in tree.splitlines() if line}
    for name in sorted(names):
        crate = crates[name]
        if crate["source"] is None:
            continue
        print("=" * 78, f"{name}: {crate['license']}", *filter(None, [crate["repository"]]), sep="\n")
        folder = Path(crate["manifest_path"]).parent
        for file in sorted(path for path in folder.iterdir() if path.is_file()):
            if file.name.lower().startswith(NAMES):
                print("-" * 78, file.read_text(errors="replace").strip(), sep="\n")


main(sys.argv[1:])
