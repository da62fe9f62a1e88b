
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

// Pictures: one at a time, of the scene, the setting and the view that are chosen.
if (views.length) {
  const picks = ["scene", "setting", "view"].map(id => document.getElementById(id));
  const photo = document.getElementById("photo");
  let shown = views[0];

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
    const real = has && isPressed(photo);
    photo.disabled = !has;
    stage.classList.toggle("real", real);
    stage.querySelector(".tag.left").textContent = real ? "photo" : "original";
  };
  toggles(photo, update);
  picks.forEach(pick => pick.addEventListener("change", choose));
  photo.hidden = stages.every(stage => stage.querySelector(".photo") === null);
  choose();
}
