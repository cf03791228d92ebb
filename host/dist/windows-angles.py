"""Compares the angles of trials that biflag.exe has recorded with those of Linux: `biflag info SESSION --json` of both."""

import json

count, worst = 0, 0.0
for number in range(1, 5):
    wine, linux = (json.load(open(f"{system}-{number}.json"))["trials"] for system in ("wine", "linux"))
    for one, other in zip(wine, linux, strict=True):
        summary = one["summary"]
        assert one["complete"] and summary["lost"] == summary["crc_errors"] == 0, one
        for angle in "yaw", "pitch", "roll":
            difference = one["angles"][f"{angle}_deg"] - other["angles"][f"{angle}_deg"]
            worst = max(worst, abs(difference) / min(trial["angles"][f"{angle}_uncertainty_deg"] for trial in (one, other)))
        count += 1
print(f"{count} trials of 20 s in real time: 0 lost, 0 CRC errors, angles at most {worst:.2f} of the smaller ± from those of Linux")
assert count and worst < 1
