// Saves a chart, a map or the view of the robot as a file: SVG and PNG as shown, CSV with the numbers.
"use strict";

/** Gives each figure of an element its buttons. */
biflag.addSaveButtons = (element, trial) => {
  for (const figure of element.querySelectorAll("figure:not(.ribbon)")) {
    const [isView, title] = [figure.matches(".scene"), figure.querySelector("h3")];
    const group = Object.assign(document.createElement("span"), { className: "save", role: "group", ariaLabel: "Save" });
    for (const format of isView ? ["png"] : ["svg", "png", "csv"]) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: format.toUpperCase() });
      button.ariaLabel = `Save ${title?.textContent ?? "the view"} as ${button.textContent}`;
      button.dataset.save = format;
      button.addEventListener("click", () => biflag.save(button, trial));
      group.append(button);
    }
    if (isView) figure.querySelector(".tools").append(group);
    else title.after(group);
  }
};

/** Saves the figure of a button, which names the format. `trial`: that of a chart. */
biflag.save = async (button, trial) => {
  const figure = button.closest("figure");
  const format = button.dataset.save;
  const name = biflag.fileName(figure.querySelector("h3")?.textContent ?? "view");
  const charts = trial?.charts.filter((chart) => figure.contains(chart.element)) ?? [];
  const canvas = figure.querySelector(".view3d");
  const map = figure.querySelector("svg");
  let file;
  if (format === "csv") file = new Blob([charts.length ? biflag.csvOfCharts(charts) : biflag.csvOfMap(map)], { type: "text/csv" });
  else if (canvas) file = await new Promise((done) => canvas.toBlob(done));
  else {
    const svg = map ? biflag.svgOfMap(map) : biflag.svgOfCharts(figure, charts);
    file = format === "svg" ? new Blob([svg], { type: "image/svg+xml" }) : await biflag.png(svg);
  }
  biflag.download(file, `${name}.${format}`);
};

/** The name of a file that shows a part of the page, without its ending. */
biflag.fileName = (part) => `${document.title} ${part}`.replace(/[^\w+−-]+/g, "_").replace(/^_|_$/g, "");

biflag.download = (file, name) => {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(file), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
};

/** The table that charts show, within their range of time; the header says names and units. */
biflag.csvOfCharts = (charts) => {
  const { table, spec } = charts[0];
  const [from, to] = charts[0].trial.range ?? [0, charts[0].trial.end];
  const columns = [];
  for (const chart of charts) {
    const unit = { "°": "_deg", " rpm": "_rpm", " mN": "_mn", " mm": "_mm", " turns": "_turns" }[chart.spec.unit] ?? "";
    const names = chart.spec.lines.flatMap(({ name }) => [name, name + "_low", name + "_high"]);
    if (chart.spec.uncertainty && !chart.spec.error) names.push(chart.spec.uncertainty);
    for (const name of names) if (table[name]) columns.push([name + unit, table[name]]);
    if (chart.spec.contact && table.contact && !columns.some(([name]) => name === "contact")) columns.push(["contact", table.contact]);
  }
  const rows = [["time_s", ...columns.map(([name]) => name)].join(",")];
  const text = (value) => (value === null ? "" : String(Number(value.toPrecision(7))));
  table.time.forEach((time, i) => {
    if (time >= from && time <= to) rows.push([time, ...columns.map(([, values]) => values[i])].map(text).join(","));
  });
  return `${rows.join("\n")}\n`;
};

biflag.csvOfMap = (map) => {
  const { x, y, value } = map.dataset;
  const rows = [...map.querySelectorAll("[data-at]")].map((mark) => mark.dataset.at);
  return `${[x, y, value].join(",")}\n${rows.join("\n")}\n`;
};

/** A map stands alone once the styles that it gets from the page are its own. */
biflag.svgOfMap = (map) => {
  const copy = map.cloneNode(true);
  const own = map.querySelectorAll("*");
  copy.querySelectorAll("*").forEach((element, i) => {
    const { fill, stroke, strokeWidth } = getComputedStyle(own[i]);
    if (element.matches("text, path, rect, circle")) Object.assign(element.style, { fill, stroke, strokeWidth });
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  const { width, height } = map.viewBox.baseVal;
  copy.setAttribute("width", width);
  copy.setAttribute("height", height);
  copy.setAttribute("style", `font: 11px ${biflag.colour("font")}; background: ${biflag.colour("card")}`);
  return new XMLSerializer().serializeToString(copy);
};

/** The charts of a figure below each other, with title and legend. */
biflag.svgOfCharts = (figure, charts) => {
  const escape = (text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
  const width = charts[0].width();
  const text = (x, y, words, more = "") => `<text x="${x.toFixed(1)}" y="${y.toFixed(1)}" ${more}>${escape(words)}</text>`;
  const parts = [text(8, 18, figure.querySelector("h3").textContent, `font-weight="600" font-size="14" fill="${biflag.colour("ink")}"`)];
  let [x, y] = [8, 38];
  const named = new Map(charts.flatMap(({ lines, trial }) => lines.map((line) => [biflag.label(line, trial.data), line])));
  for (const [words, line] of named) {
    const colour = biflag.colour(line.colour);
    parts.push(`<path d="M${x} ${y - 4}h20" stroke="${colour}" stroke-width="2" stroke-dasharray="${line.dash ?? "none"}"/>`, text(x + 26, y, words));
    x += 44 + 7 * words.length;
  }
  y = 46;
  for (const chart of charts) {
    parts.push(`<g transform="translate(0 ${y})">${chart.svg()}</g>`);
    y += chart.height();
  }
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${y}" viewBox="0 0 ${width} ${y}" font-family="${escape(biflag.colour("font"))}" ` +
    `font-size="12" fill="${biflag.colour("soft")}"><rect width="${width}" height="${y}" fill="${biflag.colour("card")}"/>${parts.join("")}</svg>`;
};

/** A picture of an SVG, three pixels for each of its own. */
biflag.png = async (svg) => {
  const picture = new Image();
  picture.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  await picture.decode();
  const canvas = Object.assign(document.createElement("canvas"), { width: 3 * picture.width, height: 3 * picture.height });
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(picture.src);
  return new Promise((done) => canvas.toBlob(done));
};
