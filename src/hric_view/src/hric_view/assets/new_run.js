"use strict";
// Form of an experiment: changed values are checked at once; a run is followed to its end, also one of another viewer.
{
  const PERIOD = 500; // time between two questions for the state of the run [ms]
  const find = (id) => document.getElementById(id);
  const place = find("new"), name = place.dataset.experiment, form = find("form");
  const fields = [...form.querySelectorAll(".field")].map((box) => ({ box, input: box.querySelector("input, select"), undo: box.querySelector(".undo") }));
  let latest = 0, after = Infinity, ended = 0, begun = false; // numbers of runs: the last one, that before ours, ours that has ended

  const initial = (input) => (input.type === "checkbox" ? input.defaultChecked : input.tagName === "SELECT" ? [...input.options].find((option) => option.defaultSelected)?.value : input.defaultValue);
  const present = (input) => (input.type === "checkbox" ? input.checked : input.value);
  const isChanged = ({ input }) => present(input) !== initial(input);
  const plain = (text) => (text.trim() === "" || !Number.isFinite(Number(text)) ? text.trim() : Number(text));

  const value = ({ box, input }) => {
    const { kind, list } = box.dataset;
    if (kind === "number") return plain(input.value);
    if (kind !== "list" || (list === undefined && !input.value.includes(","))) return kind === "list" ? plain(input.value) : present(input);
    return input.value.trim() === "" ? [] : input.value.split(",").map(plain);
  };
  const values = () => Object.fromEntries(fields.filter(isChanged).map((field) => [field.box.dataset.key, value(field)]));

  const send = (message) => {
    if (!report.send(message)) find("status").textContent = "no connection: start hric view again, and reload";
  };
  const check = () => send({ command: "check", experiment: name, values: values() });
  const mistake = (text) => {
    find("mistake").textContent = text;
    find("mistake").hidden = !text;
    if (text) find("line").textContent = "";
  };

  const mark = () => {
    for (const field of fields) {
      field.box.classList.toggle("changed", isChanged(field));
      field.undo.hidden = !isChanged(field);
    }
    const count = fields.filter(isChanged).length;
    find("count").textContent = count ? `${count} changed` : "";
    find("reset").disabled = !count;
    for (const part of form.querySelectorAll("details")) {
      const within = part.querySelectorAll(".changed").length;
      const shown = part.querySelector("summary .hint");
      if (shown) shown.textContent = within ? `${within} changed` : "";
    }
  };

  const restore = ({ input }) => {
    if (input.type === "checkbox") input.checked = input.defaultChecked;
    else input.value = initial(input);
  };

  const search = () => {
    const wanted = find("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const { box } of fields) {
      const text = `${box.dataset.key} ${box.querySelector(".hint").textContent}`.toLowerCase();
      box.hidden = !wanted.every((word) => text.includes(word));
    }
    for (const part of form.querySelectorAll("details:has(.field)")) {
      const shown = part.querySelector(".field:not([hidden])");
      part.hidden = !shown;
      if (wanted.length && shown) part.open = true;
    }
  };

  const written = ({ phase, experiment, time, duration, text, folder }) => {
    const share = duration ? `${time.toFixed(2)} of ${duration.toFixed(2)} s of robot time, ${Math.round((100 * time) / duration)} %` : "";
    if (phase === "running") return [`${experiment} is running`, share, text].filter(Boolean).join(": ");
    if (phase === "done") return `${experiment} is done: ${folder}`;
    if (phase === "cancelled") return `${experiment} was cancelled${folder ? `; what was recorded: ${folder}` : ""}`;
    return phase === "failed" ? `${experiment} has failed: ${text}` : "";
  };

  report.data = {}; // the first message is the state; a refusal does not end the connection
  report.on("state", (message) => {
    const running = message.phase === "running";
    latest = message.number;
    find("status").textContent = written(message);
    find("run").disabled = running || find("run").dataset.not !== undefined;
    find("cancel").hidden = find("progress").hidden = !running;
    if (message.duration) find("progress").value = message.time / message.duration; else find("progress").removeAttribute("value");
    find("links").hidden = running || !message.folder;
    find("replay").href = `${place.dataset.replay}&run=${encodeURIComponent(message.folder)}`;
    if (!begun) { begun = true; check(); }
    if (running || latest <= after || latest === ended) return;
    ended = latest;
    after = Infinity;
    if (message.phase === "failed") { mistake(message.text); find("status").textContent = ""; }
    if (message.phase === "done") location.assign(find("replay").href);
  });
  report.on("checked", ({ line }) => { mistake(""); find("line").textContent = line; });
  report.on("refused", ({ text }) => { after = Infinity; mistake(text); });
  report.on("lost", () => { find("status").textContent = "The connection is lost. Trying again."; });

  if (find("run").disabled) find("run").dataset.not = "";
  form.addEventListener("input", mark);
  form.addEventListener("change", (event) => { if (event.target.id !== "search") check(); });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (find("run").disabled) return;
    mistake("");
    after = latest;
    send({ command: "run", experiment: name, values: values() });
  });
  find("search").addEventListener("input", search);
  find("reset").addEventListener("click", () => { fields.forEach(restore); mark(); check(); });
  for (const field of fields) field.undo.addEventListener("click", () => { restore(field); mark(); field.input.focus(); check(); });
  find("cancel").addEventListener("click", () => { send({ command: "cancel" }); find("status").textContent = "cancelling"; });
  find("copy").addEventListener("click", () => {
    getSelection().selectAllChildren(find("line"));
    navigator.clipboard?.writeText(find("line").textContent); // only on this machine or by https
  });
  mark();
  setInterval(() => report.send({ command: "state" }), PERIOD);
}
