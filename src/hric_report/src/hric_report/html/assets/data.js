"use strict";
// Data of the page: report.data describes the contents, report.read(place) returns one of the numeric arrays.
const report = {};
{
  const KINDS = { f8: Float64Array, f4: Float32Array, u4: Uint32Array };
  let bytes;

  // Set data and arrays; numbers: all arrays in base64.
  report.load = (data, numbers) => {
    report.data = data;
    bytes = Uint8Array.from(atob(numbers), (character) => character.charCodeAt(0));
  };

  // Return an array of the page; one that has been read already stays as it is.
  report.read = (place) => (ArrayBuffer.isView(place) ? place : new KINDS[place.kind](bytes.buffer, place.offset, place.count));
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

// Return a value with a number of digits, without the sign of a zero.
report.fixed = (value, digits) => (Number(value.toFixed(digits)) || 0).toFixed(digits);

report.colour = (role) => getComputedStyle(document.documentElement).getPropertyValue("--" + role.replace(/^s(\d+)$/, (_, k) => "s" + (k % 10))).trim();
