"use strict";
// Pages without a choice of theme: that of the system.
{
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = () => { document.documentElement.dataset.theme = dark.matches ? "dark" : "light"; };
  document.getElementById("theme").hidden = true;
  dark.addEventListener("change", paint);
  paint();
}
