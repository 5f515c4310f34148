"use strict";
// Sliders of `hric try`: each change asks for a run; while one runs, only the newest change waits.
{
  const find = (id) => document.getElementById(id);
  const form = find("conditions"), inputs = [...form.querySelectorAll("input")];
  let running = true, waiting = false, before = new Map(), now = new Map(), asked = 0;

  const values = () => Object.fromEntries(inputs.map(({ name, valueAsNumber }) => [name, valueAsNumber]));
  const label = () => inputs.forEach((input) => { input.nextElementSibling.textContent = `${input.value} ${input.dataset.unit}`; });

  const ask = () => {
    label();
    if (running) { waiting = true; return; }
    running = report.send({ command: "run", values: values() });
    asked = performance.now();
    find("running").textContent = running ? "running" : "no connection: start hric try again, and reload";
  };

  const done = (text) => {
    running = false;
    find("running").textContent = text;
    if (!waiting) return;
    waiting = false;
    ask();
  };

  const written = (value, unit) => (value === null || value === undefined ? "not known" : `${Number(Math.abs(value) < 0.0005 ? 0 : value.toPrecision(3))} ${unit}`.trim());

  const row = ({ name, value, limit, unit, reply, reason }) => {
    const line = document.createElement("tr"), earlier = before.get(name);
    line.title = reason;
    [name, written(value, unit), earlier === undefined ? "" : written(earlier, unit), limit === null ? "" : written(limit, unit), reply].forEach((text, k) => {
      const cell = line.insertCell();
      cell.textContent = text;
      if (k > 0 && k < 4) cell.className = "num";
    });
    if (earlier !== undefined && earlier !== value) line.cells[1].classList.add("changed");
    return line;
  };

  report.on("scene", (message) => {
    before = now;
    now = new Map(message.figures.map(({ name, value }) => [name, value]));
    find("figures").tBodies[0].replaceChildren(...message.figures.map(row));
    done(asked ? `done in ${((performance.now() - asked) / 1000).toFixed(1)} s` : "");
    find("play").click();
  });
  report.on("refused", ({ text }) => done("refused: " + text));
  form.addEventListener("change", ask);
  form.addEventListener("input", label);
  form.addEventListener("reset", () => setTimeout(ask));
  form.addEventListener("submit", (event) => event.preventDefault());
  label();
}
