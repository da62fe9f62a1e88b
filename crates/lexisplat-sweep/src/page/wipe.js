"use strict";
document.documentElement.classList.add("js");

// Pictures: the original left of a line that moves, the compressed right of it, or their difference.
const views = [...document.querySelectorAll(".view")];
const stages = views.map(view => view.querySelector(".stage"));
const range = document.getElementById("at");
const isPressed = button => button.getAttribute("aria-pressed") === "true";
// Calls `done` after each click on `button`, which stays pressed until the next.
const toggles = (button, done) => button.addEventListener("click", () => {
  button.setAttribute("aria-pressed", !isPressed(button));
  done();
});
const place = percent => {
  range.value = percent;
  stages.forEach(stage => stage.style.setProperty("--at", percent + "%"));
};
if (views.length) {
  stages.forEach(stage => {
    const follow = event => {
      if (event.type === "pointermove" && event.pointerType !== "mouse" && !event.buttons) return;
      const box = stage.getBoundingClientRect();
      place(Math.min(100, Math.max(0, (event.clientX - box.left) / box.width * 100)));
    };
    stage.addEventListener("pointerdown", follow);
    stage.addEventListener("pointermove", follow);
    stage.addEventListener("dragstart", event => event.preventDefault());
  });
  const differ = document.getElementById("differ");
  toggles(differ, () => stages.forEach(stage => stage.classList.toggle("differs", isPressed(differ))));
  range.addEventListener("input", () => place(range.value));
  place(50);
}
