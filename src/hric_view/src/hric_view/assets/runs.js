"use strict";
// List of runs: two marked ones are shown together.
{
  const marks = [...document.querySelectorAll(".mark")], button = document.getElementById("compare");
  const update = () => {
    const marked = marks.filter(({ checked }) => checked);
    button.disabled = marked.length !== 2;
    marks.forEach((mark) => mark.removeAttribute("name"));
    marked.slice(0, 2).forEach((mark, k) => { mark.name = ["run", "other"][k]; });
  };
  marks.forEach((mark) => mark.addEventListener("change", update));
  update();
}
