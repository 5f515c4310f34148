"use strict";
// Parallel coordinates: a vertical axis per column, a line per run; dragging along an axis selects the runs in that range.
sweep.Parallel = class {
  constructor(frame) {
    this.frame = frame;
    this.density = new sweep.Density(frame.querySelector("canvas"));
    this.overlay = frame.querySelector("svg");
    this.overlay.addEventListener("pointerdown", (event) => this.grab(event));
    this.overlay.addEventListener("pointermove", (event) => this.move(event));
    this.overlay.addEventListener("pointerup", (event) => this.release(event));
    this.overlay.addEventListener("pointerleave", () => { if (!this.held) sweep.point(null); });
    this.overlay.addEventListener("keydown", (event) => this.key(event));
  }

  get columns() { return sweep.columns.filter((column) => column.on); }

  geometry() {
    const width = this.frame.clientWidth, columns = this.columns, top = 46, high = 330;
    const gaps = columns.some((column) => column.gaps), height = top + high + (gaps ? 44 : 20);
    const left = 58, right = 62, step = columns.length > 1 ? (width - left - right) / (columns.length - 1) : 0;
    const x = (k) => left + k * step, y = (share) => (share < 0 ? top + high + 26 : top + (1 - share) * high);
    return { width, height, columns, top, high, step, x, y };
  }

  draw() {
    const shape = this.geometry();
    Object.assign(this, { shape });
    this.lines();
    this.axes();
    this.mark(null);
  }

  // Draw the lines of all runs as a density.
  lines() {
    const { width, height, columns, x, y } = this.shape, { density } = this;
    density.begin(width, height, 4);
    const places = columns.map((column) => Float32Array.from(column.shares, y));
    for (let row = 0; row < sweep.count; row++) {
      const layer = sweep.layer(row);
      density.counts[layer]++;
      for (let k = 1; k < columns.length; k++) density.line(layer, x(k - 1), places[k - 1][row], x(k), places[k][row]);
    }
    density.paint(sweep.colours(), sweep.STRENGTH);
  }

  axes() {
    const { width, height, columns, top, high, step, x, y } = this.shape, { overlay } = this, add = sweep.svg;
    overlay.replaceChildren();
    overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
    overlay.style.height = this.frame.querySelector(".drawn").style.height = height + "px";
    const gaps = columns.some((column) => column.gaps);
    if (gaps) add(overlay, "text", { x: 4, y: y(-1) + 4, class: "tick" }, "none");
    columns.forEach((column, k) => {
      const group = add(overlay, "g", { class: "axis " + column.role, "data-column": column.name, transform: `translate(${x(k)} 0)`, tabindex: 0, role: "slider", "aria-label": `${column.name}: arrow keys move the selected range, escape selects all runs`, "aria-valuetext": "all" });
      const anchor = k === 0 && step < 140 ? "start" : k === columns.length - 1 && k > 0 && step < 140 ? "end" : "middle", shift = anchor === "start" ? -40 : anchor === "end" ? 44 : 0;
      const name = add(group, "text", { x: shift, y: 14, class: "name", "text-anchor": anchor }, sweep.short(column.name, Math.max(step, 90) - 8));
      add(name, "title", {}, `${column.name}${column.text ? ": " + column.text : ""}`);
      add(group, "text", { x: shift, y: 29, class: "tick", "text-anchor": anchor }, column.unit ? `[${column.unit}]` : column.labels.length ? "" : "[1]");
      add(group, "line", { y1: top, y2: top + high, class: "spine" });
      if (column.gaps) add(group, "line", { y1: y(-1) - 5, y2: y(-1) + 5, class: "spine" });
      for (const [share, text] of column.ticks(5)) {
        add(group, "line", { x1: -4, x2: 0, y1: y(share), y2: y(share), class: "spine" });
        add(group, "text", { x: -7, y: y(share) + 4, class: "tick halo", "text-anchor": "end" }, sweep.short(text, k ? Math.max(step * 0.6, 46) : 52));
      }
      if (column.limit !== null) {
        const at = column.share(column.limit);
        if (at >= 0 && at <= 1) add(add(group, "line", { x1: -9, x2: 9, y1: y(at), y2: y(at), class: "bound" }), "title", {}, `limit ${sweep.text(column.limit)} ${column.unit}`);
      }
      const brush = sweep.brushes.get(column.name);
      if (brush) {
        add(group, "rect", { x: -7, width: 14, y: y(Math.min(brush[1], 1)), height: Math.max(y(Math.max(brush[0], 0)) - y(Math.min(brush[1], 1)), 2), class: "brush" });
        group.setAttribute("aria-valuetext", `${sweep.text(column.value(brush[0]))} to ${sweep.text(column.value(brush[1]))} ${column.unit}`);
      }
      add(group, "rect", { x: -14, width: 28, y: top - 6, height: high + 12, class: "grip" });
    });
    this.marked = add(overlay, "polyline", { class: "marked", points: "" });
  }

  // Highlight the run below the pointer; null: none.
  mark(row) {
    const { columns, x, y } = this.shape;
    this.marked.setAttribute("points", row === null ? "" : columns.map((column, k) => `${x(k).toFixed(1)},${y(column.shares[row]).toFixed(1)}`).join(" "));
  }

  place(event) {
    const box = this.overlay.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  grab(event) {
    const group = event.target.closest(".axis");
    if (!group) { const row = this.nearest(...this.place(event)); if (row !== null) sweep.pick(row); return; }
    event.preventDefault();
    const column = this.columns.find((each) => each.name === group.dataset.column), share = this.share(this.place(event)[1]);
    const old = sweep.brushes.get(column.name), inside = old && share > old[0] && share < old[1];
    this.held = { column, from: share, old: inside ? old : null, moved: false };
    this.overlay.setPointerCapture(event.pointerId);
  }

  share(y) { return Math.min(Math.max(1 - (y - this.shape.top) / this.shape.high, 0), 1); }

  move(event) {
    const [px, py] = this.place(event);
    if (!this.held) { sweep.point(this.nearest(px, py), event); return; }
    const { column, from, old } = this.held, share = this.share(py);
    if (Math.abs(share - from) * this.shape.high < 3 && !this.held.moved) return;
    this.held.moved = true;
    if (old) { const by = Math.min(Math.max(share - from, -old[0]), 1 - old[1]); sweep.brushes.set(column.name, [old[0] + by, old[1] + by]); }
    else sweep.brushes.set(column.name, [Math.min(from, share), Math.max(from, share)]);
    sweep.soon();
  }

  release() {
    if (!this.held) return;
    if (!this.held.moved) sweep.brushes.delete(this.held.column.name);
    this.held = null;
    sweep.soon();
  }

  // Keyboard equivalent of a drag: arrow keys move the selected range, Escape removes it.
  key(event) {
    const group = event.target.closest(".axis"), by = { ArrowUp: 0.05, ArrowDown: -0.05 }[event.key];
    if (!group || (event.key !== "Escape" && !by)) return;
    event.preventDefault();
    const name = group.dataset.column, old = sweep.brushes.get(name) || [by > 0 ? 0 : 0.5, by > 0 ? 0.5 : 1];
    if (event.key === "Escape") sweep.brushes.delete(name);
    else { const moved = Math.min(Math.max(by, -old[0]), 1 - old[1]); sweep.brushes.set(name, [old[0] + moved, old[1] + moved]); }
    sweep.soon(() => this.overlay.querySelector(`.axis[data-column="${CSS.escape(name)}"]`)?.focus());
  }

  // Selected run whose line passes nearest to a point [CSS pixels]; null: none within 14 pixels.
  nearest(px, py) {
    const { columns, step, x, y } = this.shape;
    if (columns.length < 2 || px < x(0) || px > x(columns.length - 1)) return null;
    const k = Math.min(Math.floor((px - x(0)) / step), columns.length - 2), part = (px - x(k)) / step;
    const a = columns[k].shares, b = columns[k + 1].shares;
    let best = 14, nearest = null;
    for (let row = 0; row < sweep.count; row++) {
      if (!sweep.shown[row]) continue;
      const away = Math.abs(y(a[row]) * (1 - part) + y(b[row]) * part - py);
      if (away < best) { best = away; nearest = row; }
    }
    return nearest;
  }
};
