// Groups of buttons or links that are one stop of the Tab key: arrow keys, Home and End go from one to the next within a group.
"use strict";

/** Makes an element one stop. What it has is asked for at each key, because buttons come and go. */
biflag.rove = (group) => {
  const items = () => [...group.querySelectorAll("button, a")].filter((item) => !item.disabled);
  const choose = (chosen) => items().forEach((item) => (item.tabIndex = item === chosen ? 0 : -1));
  choose(items()[0]);
  group.addEventListener("focusin", ({ target }) => items().includes(target) && choose(target));
  group.addEventListener("keydown", (event) => {
    const all = items();
    const at = all.indexOf(document.activeElement);
    const next = { ArrowRight: at + 1, ArrowDown: at + 1, ArrowLeft: at - 1, ArrowUp: at - 1, Home: 0, End: all.length - 1 }[event.key];
    if (at < 0 || next === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    all[(next + all.length) % all.length].focus();
  });
};

/** The groups of an element: the buttons of a view and of the axis, of a chart's caption, of a table's head, the trials, and of a map its buttons and points. */
biflag.roveIn = (element) => element.querySelectorAll("div.tools, .charts figcaption, thead tr, .maps figure, .trials tbody").forEach((group) => group.querySelector("button, a") && biflag.rove(group));
