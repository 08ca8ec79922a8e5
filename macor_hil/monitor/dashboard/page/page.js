// The page's connection: what has changed comes as parts, wishes go as JSON.

import { PHONE, cells, foldAll, keepFolded, look, measure, picture, put } from "./drawing.js";
import { prepareSteering } from "./steering.js";

const at = (id) => document.getElementById(id);
const AGAIN = 1000; // ms until a lost connection is tried again

let socket = null;
let held = false;
let player = null; // of a recording
let moments = [];
let waiting = []; // parts that came while the view was held

export function wish(what) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(what));
}

const special = {
  eye: look,
  cells,
  player: showPlayer,
  moments: showMoments,
};

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "blob";
  socket.onopen = () => {
    document.body.classList.remove("offline");
    const robot = new URLSearchParams(location.search).get("robot") ?? "";
    const before = player ? { position: player.position, playing: player.playing, speed: player.speed } : {};
    wish({ robot, ...before });
  };
  socket.onmessage = ({ data }) => {
    if (typeof data !== "string") {
      if (!held) picture(data).catch(() => {}); // what is no picture is not drawn
      return;
    }
    const { parts, said, bad } = JSON.parse(data);
    if (said !== undefined) say(said, bad);
    if (!parts) return;
    if (held) waiting.push(parts);
    else put(parts, special);
    if (waiting.length > 200) waiting = [Object.assign({}, ...waiting)];
    title();
  };
  socket.onclose = () => {
    document.body.classList.add("offline");
    at("driver").textContent = "the dashboard does not answer";
    at("driver").dataset.mood = "bad";
    setTimeout(connect, AGAIN);
  };
}

function title() {
  const chosen = document.querySelector('#roster [aria-pressed="true"]');
  if (!chosen) return;
  at("name").textContent = chosen.dataset.robot;
  document.title = `${chosen.dataset.robot} · macor-hil`;
}

let forget = 0;
export function say(words, bad) {
  at("said").textContent = words;
  at("said").classList.toggle("bad", Boolean(bad));
  clearTimeout(forget);
  forget = setTimeout(() => (at("said").textContent = ""), 8000);
}

function hold() {
  if (player) {
    wish({ do: "toggle" });
    return;
  }
  held = !held;
  at("hold").textContent = held ? "Go on" : "Hold the view";
  at("hold").setAttribute("aria-pressed", held);
  if (!held) {
    waiting.forEach((parts) => put(parts, special));
    waiting = [];
  }
}

function showPlayer(value) {
  player = value;
  at("playing").hidden = false;
  at("hold").hidden = true;
  const slider = at("moment");
  slider.max = value.duration;
  if (!dragging) slider.value = value.position;
  const text = `${value.position.toFixed(1)} / ${value.duration.toFixed(1)} s`;
  at("clock").textContent = text;
  slider.setAttribute("aria-valuetext", text);
  at("play").textContent = value.playing ? "Pause" : "Play";
  if (document.activeElement !== at("speed")) at("speed").value = value.speed;
}

function showMoments(value) {
  moments = value.moments;
  const duration = player?.duration || 1;
  at("moments").replaceChildren(
    ...moments.map(([time, kind, words]) => {
      const mark = document.createElement("i");
      mark.className = kind;
      mark.title = `${words} at ${time.toFixed(1)} s`;
      mark.style.left = `${(100 * time) / duration}%`;
      return mark;
    }),
  );
  at("before").disabled = at("after").disabled = moments.length === 0;
}

function toMark(forward) {
  const here = player.position;
  const times = moments.map(([time]) => Math.max(0, time - 1)); // a second before
  const found = forward ? times.find((time) => time > here + 0.05) : times.findLast((time) => time < here - 0.5);
  if (found !== undefined) wish({ do: "seek", value: found });
}

let dragging = false;
function preparePlayer() {
  const slider = at("moment");
  slider.addEventListener("input", () => wish({ do: "seek", value: Number(slider.value) }));
  slider.addEventListener("pointerdown", () => (dragging = true));
  addEventListener("pointerup", () => (dragging = false));
  at("play").addEventListener("click", () => wish({ do: "toggle" }));
  at("before").addEventListener("click", () => toMark(false));
  at("after").addEventListener("click", () => toMark(true));
  at("speed").addEventListener("change", () => wish({ do: "speed", value: Number(at("speed").value) }));
}

const LEAPS = { ArrowLeft: -1, ArrowRight: 1, Home: -1e8, End: 1e8 };

function key(event) {
  const where = event.target;
  const typing = where.matches("select, textarea, input:not([type=range])");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === " " && !event.repeat && !where.matches("button, summary")) {
    event.preventDefault();
    hold();
  } else if (player && event.key in LEAPS) {
    event.preventDefault();
    wish({ do: "leap", value: LEAPS[event.key] });
  } else if (player && (event.key === "n" || event.key === "p")) {
    toMark(event.key === "n");
  }
}

const THEMES = { system: "light dark", dark: "dark", light: "light" };
function showTheme(name) {
  document.documentElement.style.colorScheme = THEMES[name];
  at("theme").textContent = `Theme: ${name}`;
  localStorage.setItem("macor-theme", name);
}

function prepare() {
  showTheme(localStorage.getItem("macor-theme") in THEMES ? localStorage.getItem("macor-theme") : "system");
  at("theme").addEventListener("click", () => {
    const names = Object.keys(THEMES);
    showTheme(names[(names.indexOf(localStorage.getItem("macor-theme")) + 1) % names.length]);
  });
  at("hold").addEventListener("click", hold);
  at("roster").addEventListener("click", (event) => {
    const robot = event.target.closest("button")?.dataset.robot;
    if (!robot) return;
    history.replaceState(null, "", `?robot=${encodeURIComponent(robot)}`);
    wish({ do: "choose", robot });
  });
  document.querySelectorAll("details.card").forEach((card) => {
    card.querySelector("summary").addEventListener("click", () => setTimeout(() => keepFolded(card)));
  });
  foldAll();
  PHONE.addEventListener("change", foldAll);
  const sizes = new ResizeObserver((all) => all.forEach(({ target }) => measure(target)));
  document.querySelectorAll("svg.floor").forEach((svg) => sizes.observe(svg));
  document.addEventListener("keydown", key);
  preparePlayer();
  if (document.body.classList.contains("may-steer")) {
    prepareSteering(JSON.parse(at("choices").textContent), wish);
  }
  connect();
}

prepare();
