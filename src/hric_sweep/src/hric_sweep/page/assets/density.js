"use strict";
// Density picture of many lines or points on a canvas: each adds to the sum of its kind per pixel; sums become colours.
// A hundred thousand runs are drawn within a second, and a single run remains visible.
sweep.Density = class {
  constructor(canvas) { this.canvas = canvas; }

  // Clear the canvas; width, height: size [CSS pixels]; kinds: number of kinds of lines or points.
  begin(width, height, kinds) {
    const scale = Math.min(Math.max(window.devicePixelRatio || 1, 1), 2);
    const w = Math.round(width * scale), h = Math.round(height * scale);
    Object.assign(this, { scale, w, h, counts: new Array(kinds).fill(0) });
    Object.assign(this.canvas, { width: w, height: h });
    Object.assign(this.canvas.style, { width: width + "px", height: height + "px" });
    this.sums = Array.from({ length: kinds }, () => new Float32Array(w * h));
  }

  // Draw a line from left to right, anti-aliased across its longer axis.
  line(kind, x0, y0, x1, y1) {
    const { sums: { [kind]: sum }, w, h, scale } = this;
    x0 *= scale; x1 *= scale; y0 *= scale; y1 *= scale;
    const dx = x1 - x0, dy = y1 - y0;
    if (Math.abs(dy) <= dx) {
      const slope = dy / dx, last = Math.min(Math.floor(x1), w - 1);
      for (let x = Math.ceil(x0), y = y0 + (x - x0) * slope; x <= last; x++, y += slope) {
        const row = Math.floor(y), part = y - row;
        if (row < 0 || row + 1 >= h) continue;
        sum[row * w + x] += 1 - part;
        sum[(row + 1) * w + x] += part;
      }
    } else {
      const slope = dx / dy, step = dy > 0 ? 1 : -1, rows = Math.floor(Math.abs(dy));
      for (let k = 0, y = Math.round(y0), x = x0 + (y - y0) * slope; k <= rows; k++, y += step, x += step * slope) {
        const column = Math.floor(x), part = x - column;
        if (y < 0 || y >= h || column < 0 || column + 1 >= w) continue;
        sum[y * w + column] += 1 - part;
        sum[y * w + column + 1] += part;
      }
    }
  }

  // Draw a round dot; radius in CSS pixels.
  dot(kind, x, y, radius) {
    const { sums: { [kind]: sum }, w, h, scale } = this, r = radius * scale, reach = Math.ceil(r);
    x *= scale; y *= scale;
    for (let row = Math.floor(y) - reach; row <= Math.floor(y) + reach + 1; row++) {
      if (row < 0 || row >= h) continue;
      for (let column = Math.floor(x) - reach; column <= Math.floor(x) + reach + 1; column++) {
        if (column < 0 || column >= w) continue;
        const cover = r + 0.5 - Math.hypot(column - x, row - y);
        if (cover > 0) sum[row * w + column] += Math.min(cover, 1);
      }
    }
  }

  // Paint the sums as colours, one kind over the other; colours: CSS colour of each kind; strength: opacity of each, 0 to 1.
  paint(colours, strength) {
    const { w, h } = this, context = this.canvas.getContext("2d"), image = context.createImageData(w, h), out = image.data;
    const pixel = new Float32Array(4 * w * h);
    this.sums.forEach((sum, kind) => {
      const [red, green, blue] = sweep.rgb(colours[kind]), single = Math.min(1, 1.7 / Math.max(this.counts[kind], 1) ** 0.27) * strength[kind];
      let largest = 1;
      for (let k = 0; k < sum.length; k++) if (sum[k] > largest) largest = sum[k];
      const perLog = largest > 1 ? (strength[kind] - single) / Math.log(largest) : 0;
      for (let k = 0, p = 0; k < sum.length; k++, p += 4) {
        const value = sum[k];
        if (value === 0) continue;
        const alpha = value < 1 ? value * single : single + perLog * Math.log(value), rest = 1 - alpha;
        pixel[p] = pixel[p] * rest + red * alpha;
        pixel[p + 1] = pixel[p + 1] * rest + green * alpha;
        pixel[p + 2] = pixel[p + 2] * rest + blue * alpha;
        pixel[p + 3] = pixel[p + 3] * rest + alpha;
      }
    });
    for (let p = 0; p < pixel.length; p += 4) {
      const alpha = pixel[p + 3];
      if (alpha === 0) continue;
      out[p] = pixel[p] / alpha;
      out[p + 1] = pixel[p + 1] / alpha;
      out[p + 2] = pixel[p + 2] / alpha;
      out[p + 3] = 255 * alpha;
    }
    context.putImageData(image, 0, 0);
  }
};
