"use strict";
// Page of a sweep: the selection of runs that all drawings share, the run below the pointer, themes, and reloading.
{
  const find = (id) => document.getElementById(id), { data } = report;
  const THEMES = ["auto", "light", "dark"], dark = matchMedia("(prefers-color-scheme: dark)"), KEPT = "sweep " + location.pathname;
  let theme = "auto", waiting = false, picked = null;
  sweep.parallel = new sweep.Parallel(find("parallel"));
  sweep.matrix = new sweep.Matrix(find("matrix"));
  const { parallel, matrix } = sweep;

  // Keep the user's choices over a reload; in a browser without storage for local files they are lost.
  const keep = () => {
    const on = sweep.columns.filter((column) => column.on).map((column) => column.name);
    const saved = { brushes: [...sweep.brushes], hidden: [...sweep.hidden], on, theme, picked: picked === null ? null : sweep.ids[picked], reload: find("reload")?.checked, top: scrollY };
    try { sessionStorage.setItem(KEPT, JSON.stringify(saved)); } catch { /* nothing is saved */ }
  };
  const recall = () => {
    let saved = null;
    try { saved = JSON.parse(sessionStorage.getItem(KEPT)); } catch { /* nothing was saved */ }
    if (!saved || !data.running) return;
    for (const [name, range] of saved.brushes) sweep.brushes.set(name, range);
    for (const kind of saved.hidden) sweep.hidden.add(kind);
    for (const column of sweep.columns) column.on = saved.on.includes(column.name);
    theme = saved.theme;
    if (find("reload")) find("reload").checked = saved.reload;
    const row = saved.picked === null ? -1 : sweep.ids.indexOf(saved.picked);
    if (row >= 0) sweep.pick(row);
    setTimeout(() => scrollTo(0, saved.top));
  };

  const describe = () => {
    const limits = [...sweep.brushes].map(([name, [low, high]]) => {
      const column = sweep.columns.find((each) => each.name === name);
      if (!column) return "";
      if (column.labels.length) return `${name}: ${column.labels.filter((_, k) => column.share(k) >= low && column.share(k) <= high).join(", ") || "none"}`;
      return `${name} ${sweep.text(column.value(low))} to ${sweep.text(column.value(high))}${column.unit ? " " + column.unit : ""}`;
    });
    const counts = sweep.KINDS.map((_, kind) => sweep.kinds.reduce((sum, value, row) => sum + (value === kind && sweep.shown[row]), 0));
    const among = [counts[1] && `${counts[1]} of them ${data.words.exceeded}`, counts[2] && `${counts[2]} failed`].filter(Boolean).join(", ");
    find("shown").textContent = `${sweep.left.toLocaleString("en")} of ${sweep.count.toLocaleString("en")} runs${among ? ": " + among : ""}${limits.length ? "; kept: " + limits.join("; ") : ""}`;
    find("clear").hidden = !sweep.brushes.size;
    document.querySelectorAll("#kinds button").forEach((button) => button.setAttribute("aria-pressed", String(!sweep.hidden.has(button.dataset.kind))));
  };

  const redraw = () => { sweep.filter(); parallel.draw(); matrix.draw(); describe(); };
  // Redraw once before the next frame, even if several events request it.
  sweep.soon = (then) => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; redraw(); then?.(); });
  };

  const name = (row) => `${sweep.ids[row]} (run ${sweep.index[row]})`;
  const outcome = (row) => ({ exceeded: data.words.exceeded, failed: "failed", fine: "" })[sweep.KINDS[sweep.kinds[row]]];

  // Show the values of the run below the pointer; null: none.
  sweep.point = (row, event) => {
    const tip = find("tip");
    tip.hidden = row === null;
    parallel.mark(row ?? picked);
    matrix.mark(row ?? picked);
    if (row === null) return;
    const head = document.createElement("b"), table = document.createElement("table");
    head.textContent = name(row) + (outcome(row) ? ", " + outcome(row) : "");
    for (const column of sweep.columns) {
      const line = table.insertRow();
      line.className = column.role;
      line.insertCell().textContent = column.name;
      line.insertCell().textContent = column.valueText(row);
    }
    tip.replaceChildren(head, table);
    const { offsetWidth: wide, offsetHeight: high } = tip;
    tip.style.left = Math.max(4, event.clientX + 18 + wide > innerWidth ? event.clientX - wide - 14 : event.clientX + 18) + "px";
    tip.style.top = Math.max(4, Math.min(event.clientY + 14, innerHeight - high - 6)) + "px";
  };

  // Show the run that was clicked, with the command that repeats it.
  sweep.pick = (row) => {
    picked = row;
    find("picked").hidden = false;
    find("picked-name").textContent = name(row) + (outcome(row) ? ", " + outcome(row) : "");
    find("picked-command").textContent = `${data.command} ${sweep.ids[row]}`;
  };

  const paint = () => {
    document.documentElement.dataset.theme = theme === "dark" || (theme === "auto" && dark.matches) ? "dark" : "light";
    find("theme").textContent = "theme: " + theme;
    redraw();
  };

  const choices = () => {
    for (const column of sweep.columns) {
      const label = document.createElement("label"), box = document.createElement("input");
      Object.assign(box, { type: "checkbox", checked: column.on });
      box.addEventListener("change", () => { column.on = box.checked; if (!box.checked) sweep.brushes.delete(column.name); sweep.soon(); });
      label.append(box, " " + column.name);
      find("choices").append(label, " ");
    }
  };

  const copy = async (button, text) => {
    try { await navigator.clipboard.writeText(text); } catch {
      const area = document.createElement("textarea"); // for browsers that give local files no access to the clipboard
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    const { textContent } = button;
    if (textContent === "copied") return;
    button.textContent = "copied";
    setTimeout(() => { button.textContent = textContent; }, 1500);
  };

  const connect = () => {
    find("theme").addEventListener("click", () => { theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]; paint(); });
    dark.addEventListener("change", paint);
    find("clear").addEventListener("click", () => { sweep.brushes.clear(); sweep.soon(); });
    document.querySelectorAll("#kinds button").forEach((button) => button.addEventListener("click", () => {
      const { kind } = button.dataset;
      if (!sweep.hidden.delete(kind)) sweep.hidden.add(kind);
      sweep.soon();
    }));
    document.querySelectorAll("button.copy").forEach((button) => button.addEventListener("click", () => copy(button, button.dataset.command ?? button.previousElementSibling.textContent)));
    let width = innerWidth;
    addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; sweep.soon(); } });
    addEventListener("beforeprint", () => document.querySelectorAll("details:not([open])").forEach((one) => { one.open = true; }));
    if (!data.running) return;
    addEventListener("pagehide", keep);
    setInterval(() => { if (find("reload").checked && !parallel.held && find("tip").hidden) location.reload(); }, 1000 * data.period);
  };

  recall();
  choices();
  connect();
  paint();
  report.ready = true;
}
