"use strict";
// Scatter matrix: scatter plots of pairs of columns below the diagonal, histograms on it, rank correlations above it.
sweep.Matrix = class {
  constructor(frame) {
    this.frame = frame;
    this.density = new sweep.Density(frame.querySelector("canvas"));
    this.overlay = frame.querySelector("svg");
    this.overlay.addEventListener("pointermove", (event) => sweep.point(this.nearest(...this.place(event)), event));
    this.overlay.addEventListener("pointerleave", () => sweep.point(null));
    this.overlay.addEventListener("pointerdown", (event) => { const row = this.nearest(...this.place(event)); if (row !== null) sweep.pick(row); });
  }

  get columns() { return sweep.columns.filter((column) => column.on).slice(0, report.data.pairs); }

  draw() {
    const columns = this.columns, width = Math.min(this.frame.clientWidth, 1060), left = 74, gap = 8;
    const side = columns.length ? (width - left - 4) / columns.length : 0, at = (k) => left + k * side, inner = side - gap;
    const height = 8 + columns.length * side + 42;
    this.shape = { columns, side, at, inner, width, height, top: (k) => 8 + k * side };
    this.points();
    this.axes();
    this.mark(null);
  }

  // Picture coordinate [CSS pixels] of a relative position (0 to 1) within cell k.
  x(k, share) { return this.shape.at(k) + 3 + share * (this.shape.inner - 6); }
  y(k, share) { return this.shape.top(k) + this.shape.inner - 3 - share * (this.shape.inner - 6); }

  points() {
    const { columns, width, height } = this.shape, { density } = this, radius = sweep.count > 20000 ? 0.5 : sweep.count > 2000 ? 1 : 1.8;
    density.begin(width, height, 4);
    for (let row = 0; row < sweep.count; row++) {
      const layer = sweep.layer(row);
      density.counts[layer]++;
      for (let line = 1; line < columns.length; line++) {
        const v = columns[line].shares[row];
        if (v < 0) continue;
        const y = this.y(line, v);
        for (let k = 0; k < line; k++) {
          const u = columns[k].shares[row];
          if (u >= 0) density.dot(layer, this.x(k, u), y, radius);
        }
      }
    }
    density.paint(sweep.colours(), sweep.STRENGTH);
  }

  axes() {
    const { columns, side, at, inner, width, height, top } = this.shape, { overlay } = this, add = sweep.svg;
    overlay.replaceChildren();
    overlay.setAttribute("viewBox", `0 0 ${width} ${height}`);
    Object.assign(overlay.style, { width: width + "px", height: height + "px" });
    this.frame.querySelector(".drawn").style.height = height + "px";
    columns.forEach((column, line) => {
      columns.forEach((other, k) => {
        if (k < line) add(overlay, "rect", { x: at(k), y: top(line), width: inner, height: inner, class: "cell", "data-x": k, "data-y": line });
        if (k === line) this.bars(column, k);
        if (k > line) this.correlation(column, other, line, k);
      });
      const unit = column.labels.length ? "" : ` [${column.unit || 1}]`;
      const below = add(overlay, "text", { x: at(line) + inner / 2, y: height - 8, class: "name", "text-anchor": "middle" }, sweep.short(column.name + unit, side - 4));
      add(below, "title", {}, column.name + unit);
      const turned = `rotate(-90 12 ${top(line) + inner / 2})`;
      add(overlay, "text", { x: 12, y: top(line) + inner / 2, class: "name", "text-anchor": "middle", transform: turned }, sweep.short(column.name + unit, side - 4));
      const ticks = column.ticks(side > 120 ? 3 : 2), some = ticks.length > 5 ? [ticks[0], ticks[ticks.length - 1]] : ticks;
      for (const [share, text] of some) {
        const anchor = share < 0.1 ? "start" : share > 0.9 ? "end" : "middle"; // within its own column
        add(overlay, "text", { x: this.x(line, share), y: height - 26, class: "tick", "text-anchor": anchor }, sweep.short(text, side / some.length));
        if (line) add(overlay, "text", { x: at(0) - 6, y: this.y(line, share) + 4, class: "tick", "text-anchor": "end" }, sweep.short(text, 46));
      }
    });
    this.marked = add(overlay, "g", { class: "marks" });
  }

  // Histogram of a column: all runs, and in front of them the runs that are selected.
  bars(column, k) {
    const { at, inner, top } = this.shape, add = sweep.svg, bins = column.labels.length || 24, all = new Float64Array(bins), shown = new Float64Array(bins);
    for (let row = 0; row < sweep.count; row++) {
      const share = column.shares[row];
      if (share < 0) continue;
      const bin = Math.min(Math.floor(share * bins), bins - 1);
      const counts = sweep.counts ? sweep.counts[row] : 1;
      all[bin] += counts;
      shown[bin] += counts * sweep.shown[row];
    }
    const most = Math.max(...all) || 1, wide = (inner - 6) / bins;
    add(this.overlay, "rect", { x: at(k), y: top(k), width: inner, height: inner, class: "cell" });
    for (const [counts, look] of [[all, "all"], [shown, "shown"]]) {
      counts.forEach((count, bin) => {
        const high = (count / most) * (inner - 12);
        if (count && report.data.spread) add(this.overlay, "rect", { x: at(k) + 3 + bin * wide, y: top(k) + inner - 3 - high, width: Math.max(wide - 0.7, 0.5), height: high, class: "bar " + look });
      });
    }
  }

  correlation(column, other, line, k) {
    const { at, inner, top } = this.shape, value = column.rank[other.name];
    if (value === undefined || value === null) return;
    const size = Math.abs(value);
    sweep.svg(this.overlay, "rect", { x: at(k), y: top(line), width: inner, height: inner, class: value > 0 ? "rank up" : "rank down", "fill-opacity": (0.75 * size).toFixed(3) });
    sweep.svg(this.overlay, "text", { x: at(k) + inner / 2, y: top(line) + inner / 2 + 5, class: "value", "text-anchor": "middle" }, (Math.round(100 * value) / 100 || 0).toFixed(2));
  }

  place(event) {
    const box = this.overlay.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  mark(row) {
    this.marked.replaceChildren();
    if (row === null) return;
    const { columns } = this.shape;
    for (let line = 1; line < columns.length; line++) for (let k = 0; k < line; k++) {
      const u = columns[k].shares[row], v = columns[line].shares[row];
      if (u >= 0 && v >= 0) sweep.svg(this.marked, "circle", { cx: this.x(k, u), cy: this.y(line, v), r: 4 });
    }
  }

  nearest(px, py) {
    const { columns, side, at, top } = this.shape, k = Math.floor((px - at(0)) / side), line = Math.floor((py - top(0)) / side);
    if (k < 0 || line <= k || line >= columns.length) return null;
    let best = 10, nearest = null;
    for (let row = 0; row < sweep.count; row++) {
      const u = columns[k].shares[row], v = columns[line].shares[row];
      if (!sweep.shown[row] || u < 0 || v < 0) continue;
      const away = Math.hypot(this.x(k, u) - px, this.y(line, v) - py);
      if (away < best) { best = away; nearest = row; }
    }
    return nearest;
  }
};
