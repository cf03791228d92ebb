// What each chart draws: columns of a table, their names, colours and styles. A legend entry hides all curves with its
// `key`. `least` is the smallest span of the axis, so that noise is not enlarged to fill it.
"use strict";

/** The name of a curve; what both sides of a comparison are called is in the data of the trial. */
biflag.label = ({ label }, data) => (typeof label === "function" ? label(data) : label);

{
  const angle = (name, height) => ({
    table: "attitude",
    unit: "°",
    decimals: 2,
    least: 1,
    height,
    lines: [
      { name, key: "own", label: ({ own }) => own, colour: "measured", width: 2 },
      { name: "model_" + name, key: "model", label: ({ other }) => other, colour: "model", width: 2, dash: [8, 4] },
      { name: "true_" + name, key: "truth", label: "truth", colour: "truth", width: 1.5, dash: [2, 3] },
    ],
  });
  const error = (name) => ({
    table: "attitude",
    unit: "°",
    decimals: 3,
    least: 0.2,
    height: 104,
    error: true,
    lines: [{ name: "error_" + name, key: "error_" + name, label: ({ own, other }) => `${other} minus ${own}`, colour: "model", width: 1.5 }],
  });
  const force = (axis, strip) => ({
    table: "forces",
    unit: " mN",
    decimals: 2,
    least: 0.2,
    height: strip ? 104 : 136,
    strip,
    contact: true,
    lines: [1, 2].map((k) => ({ name: axis + k, key: "force" + k, label: `flagellum ${k}`, colour: "flagellum" + k, width: 1.5 })),
  });
  const touch = (name, label, unit, least) => ({
    table: "forces",
    unit,
    decimals: 2,
    least,
    height: 130,
    contact: true,
    lines: [{ name, key: name, label, colour: "measured", width: 1.5 }],
  });
  biflag.CHARTS = {
    yaw: { ...angle("yaw", 210), uncertainty: "uncertainty" },
    pitch: angle("pitch", 150),
    roll: angle("roll", 150),
    error_yaw: { ...error("yaw"), uncertainty: "uncertainty" },
    error_pitch: error("pitch"),
    error_roll: error("roll"),
    motors: {
      table: "motors",
      unit: " rpm",
      decimals: 1,
      least: 2,
      height: 160,
      lines: [
        { name: "speed1", label: "flagellum 1", colour: "flagellum1", width: 2 },
        { name: "speed2", label: "flagellum 2", colour: "flagellum2", width: 2 },
        { name: "target1", label: "target 1", colour: "ink", width: 1, dash: [6, 10] },
        { name: "target2", label: "target 2", colour: "ink", width: 1, dash: [2, 8] },
      ],
    },
    force_z: force("z", false),
    force_x: force("x", true),
    force_y: force("y", true),
    gap: touch("gap", "smallest gap", " mm", 1),
    winding: touch("winding", "winding", " turns", 0.1),
    link: {
      table: "link",
      unit: "",
      decimals: 0,
      least: 2,
      height: 150,
      lines: [
        { name: "received", label: "received", colour: "measured", width: 1.5, stepped: true },
        { name: "lost", label: "lost", colour: "bad", bars: true },
        { name: "retries", label: "retries", colour: "model", bars: true },
        { name: "board", label: "board errors", colour: "flagellum1", bars: true },
      ],
    },
  };
}
