// Puts newer pieces of the page in their places as the coordinator sends them, and fetches the picture when there is a new
// one. The page is complete without it.
"use strict";

const at = (id) => document.getElementById(id);
const shown = at("shown"), exposure = at("exposure"), view = at("view"), zoom = at("zoom");
const name = document.querySelector("h1").textContent;

let available = 0;   // passes of the newest picture that the coordinator has
let wanted = "";     // address of the picture that should be there
let there = "";      // address of the one that is
let fetching = false;

function say(text, calm) {
  at("connection").textContent = text;
  at("connection").classList.toggle("calm", Boolean(calm));
}

function describe(passes) {
  const which = passes === 1 ? "pass 0" : `passes 0 to ${passes - 1}`;
  return view.value === "error" ? `Error of ${which}` : `${which[0].toUpperCase()}${which.slice(1)} at ${exposure.value} EV`;
}

function look() {
  at("stops").textContent = `${exposure.value} EV`;
  exposure.disabled = view.value === "error";
  at("scale").hidden = view.value !== "error";
  if (available > 0) {
    wanted = view.value === "error"
      ? `/image.png?passes=${available}&view=error`
      : `/image.png?passes=${available}&exposure=${exposure.value}`;
    load();
  }
}

// One at a time: a slider asks for the next when the last has come.
async function load() {
  if (fetching || wanted === there) return;
  fetching = true;
  const address = wanted;
  try {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(await answer.text());
    const passes = Number(answer.headers.get("beamfarm-passes"));
    const caption = describe(passes);
    const url = URL.createObjectURL(await answer.blob());
    const before = shown.src;
    shown.src = url;
    await shown.decode();
    shown.hidden = false;
    shown.alt = caption;
    shown.dataset.passes = passes;
    at("caption").textContent = caption;
    if (before.startsWith("blob:")) URL.revokeObjectURL(before);
    there = address;
  } catch (error) {
    // The next picture comes soon enough.
    wanted = there;
  }
  fetching = false;
  if (wanted !== there) load();
}

function zoomed() {
  const factor = zoom.value === "fit" ? 0 : Number(zoom.value);
  shown.classList.toggle("zoomed", factor > 0);
  shown.style.width = factor > 0 ? `${factor * shown.getAttribute("width")}px` : "";
}

// Drag to move a picture that is larger than its frame.
let drag = null;
at("frame").addEventListener("pointerdown", (event) => {
  if (event.pointerType === "mouse" && zoom.value !== "fit") {
    drag = { x: event.clientX + at("frame").scrollLeft, y: event.clientY + at("frame").scrollTop };
    event.preventDefault();
  }
});
addEventListener("pointermove", (event) => {
  if (drag) at("frame").scrollTo({ left: drag.x - event.clientX, top: drag.y - event.clientY, behavior: "instant" });
});
addEventListener("pointerup", () => { drag = null; });

at("apply").hidden = true;
at("zooming").hidden = false;
at("controls").addEventListener("submit", (event) => event.preventDefault());
for (const input of [exposure, view]) input.addEventListener("input", look);
zoom.addEventListener("input", zoomed);

at("writing").addEventListener("submit", async (event) => {
  event.preventDefault();
  at("written").textContent = "Writing…";
  try {
    const answer = await fetch("/write", { method: "POST", headers: { accept: "text/plain" } });
    at("written").textContent = `${answer.ok ? "✓" : "✕"} ${await answer.text()}`;
  } catch (error) {
    at("written").textContent = "✕ The coordinator was not reached.";
  }
});

const news = new EventSource("/live");
for (const place of ["state", "curve", "workers", "failures", "log"]) {
  news.addEventListener(place, (event) => {
    at(place).innerHTML = event.data;
    const title = at(place).querySelector("[data-title]");
    if (title) document.title = `${title.dataset.title} – ${name}`;
  });
}
news.addEventListener("image", (event) => {
  available = Number(event.data);
  look();
});
news.addEventListener("over", () => {
  news.close();
  say("The job is over: this is how it ended.", true);
});
news.addEventListener("open", () => say(""));
news.addEventListener("error", () => say("No connection to the coordinator. Trying again…"));
