"use strict";
// Conditions of `hric try`: each change asks for a run; while one runs, only the newest change waits.
{
  const find = (id) => document.getElementById(id);
  const form = find("conditions"), inputs = [...form.querySelectorAll("input, select")];
  const FINEST = 0.0005; // size of a number below which it is shown as 0; also half of the step of a shown length [m]
  let running = true, waiting = false, again = false, before = new Map(), now = new Map(), chosen, asked = 0;

  const values = () => Object.fromEntries(inputs.map(({ name, value }) => [name, Number(value)]));
  const worded = ({ options, dataset }, value) => (options ? options[value].text : `${value} ${dataset.unit}`);
  const label = () => inputs.filter(({ type }) => type === "range").forEach((input) => { input.nextElementSibling.textContent = worded(input, input.value); });
  const differing = (a, b) => inputs.filter(({ name }) => a[name] !== b[name]);

  // Say what goes on; old: the figures are not those of the conditions above them.
  const tell = (text, old) => {
    find("running").textContent = text;
    find("figures").classList.toggle("old", old);
  };

  const ask = () => {
    label();
    if (running) { waiting = true; return; }
    running = report.send({ command: "run", values: values() });
    asked = performance.now();
    tell(running ? "running" : "no connection: start hric try again, and open its new address", true);
  };

  const done = (text, old) => {
    running = false;
    tell(text, old);
    if (!waiting) return;
    waiting = false;
    ask();
  };

  const rounded = (value, unit) => {
    if (Math.abs(value) < FINEST) return 0;
    return unit === "m" ? Number(value.toFixed(3)) : Number(value.toPrecision(3));
  };
  const apart = ({ reply }) => reply === "no contact";
  const written = (figure) => (apart(figure) ? "no contact" : figure.value === null ? "not known" : `${rounded(figure.value, figure.unit)} ${figure.unit}`.trim());

  // Return the difference of two shown values; "": there is none to be shown.
  const change = ({ value, unit }, earlier) => {
    if (value === null || (earlier?.value ?? null) === null) return "";
    const step = rounded(rounded(value, unit) - rounded(earlier.value, unit), unit);
    return step ? `${step > 0 ? "+" : "\u2212"}${Math.abs(step)}` : "same";
  };

  // Return how far a figure is beyond its limit, negative: within it; null: not known, or there is no limit.
  const beyond = ({ value, limit, lower }) => (value === null || limit === null ? null : lower ? limit - value : value - limit);

  // Return whether a figure is worse or better than before: nearer to its limit or farther from it; "": neither, or not known.
  const trend = (figure, earlier) => {
    if (!earlier || apart(figure) || apart(earlier)) return "";
    if ((figure.value === null) !== (earlier.value === null)) return figure.value === null ? "no longer known" : "now known";
    const [now, then] = [beyond(figure), beyond(earlier)];
    if (now === null || then === null || !rounded(now - then, figure.unit)) return "";
    return now > then ? "worse" : "better";
  };

  const row = (figure) => {
    const { name, value, limit, unit, reply, reason } = figure, line = document.createElement("tr"), earlier = before.get(name);
    const texts = [name, written(figure), earlier ? written(earlier) : "", change(figure, earlier), limit === null ? "" : written({ value: limit, unit }), apart(figure) ? "" : reply];
    texts.forEach((text, k) => {
      const cell = line.insertCell();
      cell.textContent = text;
      if (k > 0 && k < 5) cell.className = "num";
    });
    const add = (cell, text, kind) => cell.append(Object.assign(document.createElement("small"), { textContent: text, className: kind }));
    line.title = reason;
    if (value === null || reply === "no limit") add(line.cells[0], reason, "note");
    const mark = trend(figure, earlier);
    add(line.cells[3], mark, mark);
    return line;
  };

  report.follow = true; // connect again when the connection is lost
  report.on("scene", (message) => {
    const due = again && differing(message.values, values()).length > 0;
    again = false;
    if (due) { running = waiting = false; ask(); return; } // after a lost connection the run at the start comes first
    const changed = chosen ? differing(chosen, message.values) : [];
    if (!chosen || changed.length) {
      before = now;
      now = new Map(message.figures.map((figure) => [figure.name, figure]));
      find("changes").textContent = changed.map((input) => `${input.name}: ${input.options ? worded(input, chosen[input.name]) : chosen[input.name]} to ${worded(input, message.values[input.name])}`.trim()).join(", ");
      chosen = message.values;
    }
    find("figures").tBodies[0].replaceChildren(...message.figures.map(row));
    waiting ||= differing(chosen, values()).length > 0;
    done(asked ? `done in ${((performance.now() - asked) / 1000).toFixed(1)} s` : "", false);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) find("play").click();
  });
  report.on("refused", ({ text }) => done(`refused: ${text}.${chosen ? " The figures below are those of the last run." : ""}`, true));
  report.on("lost", () => {
    running = again = true; // until the connection is there again, whose first message is a run
    tell("The connection is lost. Trying again.", true);
  });
  form.addEventListener("change", ask);
  form.addEventListener("input", label);
  form.addEventListener("reset", () => setTimeout(ask));
  form.addEventListener("submit", (event) => event.preventDefault());
  label();
}
