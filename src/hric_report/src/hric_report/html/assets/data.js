"use strict";
// Data of the page: report.data describes the contents, report.read(place) returns one of the numeric arrays.
const report = { data: JSON.parse(document.getElementById("data").textContent) };
{
  const KINDS = { f8: Float64Array, f4: Float32Array, u4: Uint32Array };
  const text = atob(document.getElementById("numbers").textContent);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  report.read = (place) => new KINDS[place.kind](bytes.buffer, place.offset, place.count);
}

// Return the number of values of an increasing array that are not above `value`.
report.countUntil = (times, value) => {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
};

report.colour = (role) => getComputedStyle(document.documentElement).getPropertyValue("--" + role.replace(/^s(\d+)$/, (_, k) => "s" + (k % 10))).trim();
