// The page: the open trial, the colour scheme, printing, and the order of the table.
"use strict";

{
  const trials = new Map();
  // `page.html?embed` shows the moving robot alone, as for a frame of a website.
  if (new URLSearchParams(location.search).has("embed")) {
    document.documentElement.classList.add("embed");
    document.body.classList.add("opens-first");
  }
  const sections = [...document.querySelectorAll("section.trial[data-data]")];
  const isSession = document.body.classList.contains("session");

  const picture = document.querySelector("figure.hero");
  const hero = picture && new biflag.Player(picture);

  const open = (section) => {
    if (!section) return;
    if (hero?.playing) hero.toggle();
    for (const other of sections) other.hidden = isSession && other !== section;
    for (const [other, trial] of trials) if (other !== section && trial.playing) trial.toggle();
    if (trials.has(section)) trials.get(section).resize();
    else trials.set(section, new biflag.Trial(section));
    for (const row of document.querySelectorAll("tr[data-trial]")) row.classList.toggle("open", row.dataset.trial === section.id);
  };

  for (const [step, selector] of [[-1, ".previous"], [1, ".next"]]) {
    sections.forEach((section, i) => {
      const button = section.querySelector(selector);
      const other = sections[i + step];
      if (!button) return;
      button.disabled = !other;
      button.addEventListener("click", () => (location.hash = other.id));
    });
  }

  const follow = () => {
    const section = sections.find((other) => other.id === biflag.Address.section());
    open(section ?? (document.body.classList.contains("opens-first") ? sections[0] : undefined));
    section?.scrollIntoView();
  };
  if (isSession) {
    addEventListener("hashchange", follow);
    follow();
  } else {
    open(sections[0]);
  }

  const repaint = () => [...trials.values(), hero].forEach((player) => player?.repaint());
  if (hero) new ResizeObserver(() => hero.repaint()).observe(picture);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  const printsAll = document.body.classList.contains("print-all");
  /** What to restore after printing: hidden sections, and the place of the table. */
  let restore = [];
  const paper = (on) => {
    document.documentElement.classList.toggle("paper", on);
    restore.forEach((undo) => undo());
    restore = [];
    if (on) {
      // Printed, the results of all trials come before the first trial.
      const overview = document.querySelector("body > aside > .overview");
      if (overview) {
        document.querySelector("body > header").append(overview);
        restore.push(() => document.querySelector("body > aside").prepend(overview));
      }
      for (const player of [...trials.values(), hero]) if (player?.playing) player.toggle();
      for (const section of printsAll ? sections.filter((section) => section.hidden) : []) {
        section.hidden = false;
        restore.push(() => (section.hidden = true));
        if (!trials.has(section)) trials.set(section, new biflag.Trial(section));
      }
    }
    repaint();
  };
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));

  for (const maps of document.querySelectorAll(".maps")) biflag.addSaveButtons(maps);
  for (const part of document.querySelectorAll("body > header, body > aside")) biflag.roveIn(part);

  for (const button of document.querySelectorAll("th button")) {
    button.addEventListener("click", () => {
      const cell = button.closest("th");
      const rows = cell.closest("table").tBodies[0];
      const sign = cell.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      const key = (row) => row.cells[cell.cellIndex].dataset.key ?? "";
      const compare = (a, b) => (a === "" || b === "" ? (a === "") - (b === "") : sign * (Number(a) - Number(b)));
      for (const other of cell.parentElement.cells) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      rows.append(...[...rows.rows].sort((a, b) => compare(key(a), key(b))));
    });
  }
  // The robot moves, unless the address names a moment or the reader wants no motion.
  const shown = trials.get(sections.find((section) => !section.hidden)) ?? hero;
  if (shown && !location.hash && !matchMedia("(prefers-reduced-motion: reduce)").matches) shown.begin();
  document.documentElement.dataset.ready = "yes";
}
