"use strict";
// What the page holds, and where its numbers are: report.data is the description, report.read(place) a typed array in it.
const report = { data: JSON.parse(document.getElementById("data").textContent) };
{
  const KINDS = { f8: Float64Array, f4: Float32Array, u4: Uint32Array };
  const text = atob(document.getElementById("numbers").textContent);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  report.read = (place) => new KINDS[place.kind](bytes.buffer, place.offset, place.count);
}

// Number of values of a rising array that are not above `value`.
report.countUntil = (times, value) => {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
};

report.colour = (role) => getComputedStyle(document.documentElement).getPropertyValue("--" + role.replace(/^s(\d+)$/, (_, k) => "s" + (k % 10))).trim();
