"use strict";
document.documentElement.classList.add("js");

// Tables: keep all columns that name a row in sight where they leave room for the others.
const pin = grid => {
  const names = [...grid.querySelectorAll("thead tr:last-child .name")];
  grid.classList.remove("pinned");
  if (!grid.clientWidth || names.length < 2) return;
  let left = 0;
  names.forEach((name, i) => {
    grid.style.setProperty("--name-" + (i + 1), left + "px");
    left += name.offsetWidth;
  });
  grid.classList.toggle("pinned", left < grid.clientWidth / 2);
};
const pinAll = () => document.querySelectorAll(".grid").forEach(pin);
document.querySelectorAll("details").forEach(details => details.addEventListener("toggle", pinAll));
addEventListener("resize", pinAll);
pinAll();

// Pictures: one at a time, original left of the line and compressed right of it.
const views = [...document.querySelectorAll(".view")];
if (views.length) {
  const picks = ["scene", "setting", "view"].map(id => document.getElementById(id));
  const range = document.getElementById("at");
  const differ = document.getElementById("differ");
  const photo = document.getElementById("photo");
  const stages = views.map(view => view.querySelector(".stage"));
  let shown = views[0];

  const place = percent => {
    range.value = percent;
    stages.forEach(stage => stage.style.setProperty("--at", percent + "%"));
  };
  // Each list offers what there is for the choices before it, and keeps its own if it can.
  const choose = () => {
    let left = views;
    picks.forEach(pick => {
      const values = [...new Set(left.map(view => view.dataset[pick.id]))];
      const value = values.includes(pick.value) ? pick.value : values[0];
      pick.replaceChildren(...values.map(text => new Option(text, text, false, text === value)));
      left = left.filter(view => view.dataset[pick.id] === value);
    });
    shown = left[0];
    views.forEach(view => { view.hidden = view !== shown; });
    update();
  };
  const update = () => {
    const stage = shown.querySelector(".stage");
    const has = stage.querySelector(".photo") !== null;
    const real = has && photo.getAttribute("aria-pressed") === "true";
    photo.disabled = !has;
    stage.classList.toggle("real", real);
    stage.classList.toggle("differs", differ.getAttribute("aria-pressed") === "true");
    stage.querySelector(".tag.left").textContent = real ? "photo" : "original";
  };
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
  [differ, photo].forEach(button => button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") !== "true");
    update();
  }));
  picks.forEach(pick => pick.addEventListener("change", choose));
  range.addEventListener("input", () => place(range.value));
  photo.hidden = stages.every(stage => stage.querySelector(".photo") === null);
  place(50);
  choose();
}
