// The card that steers: buttons and fields for everything, and the mouse on the arena.

const at = (id) => document.getElementById(id);

const FAULTS = [
  "drop:p=0.01", "flip:p=0.005", "delay:p=0.02,time=0.05", "truncate:p=0.05", "stall:at=0,for=1", "cut:at=0,for=2",
  "dead-sensor:sensor=2", "stuck-sensor:sensor=3", "dirty-sensor:part=0.5", "weak-motor:wheel=left,part=0.6",
  "jammed-motor:wheel=right,for=2", "worn-wheel:wheel=left,part=0.9", "frozen-camera:for=5", "dark-camera:part=0.3",
  "turned-camera:angle=15",
];

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function button(text, action, title = "") {
  const made = element("button", { type: "button", title }, text);
  made.addEventListener("click", action);
  return made;
}

function group(name, ...children) {
  return element("fieldset", {}, element("legend", {}, name), ...children);
}

function choice(label, names) {
  const select = element("select", { ariaLabel: label }, ...names.map((each) => element("option", {}, each)));
  return select;
}

function number(label, step) {
  return element("input", { type: "number", step, value: "0", ariaLabel: label });
}

// Tells whether all fields are filled; goes to the first one that is not.
function filled(...fields) {
  const empty = fields.find((field) => field.value.trim() === "");
  empty?.focus();
  return !empty;
}

export function prepareSteering({ planners, goals }, wish) {
  const planner = choice("planner", planners);
  const goal = choice("goal", goals);
  const what = choice("what is placed", ["robot"]);
  const [x, y, heading] = [number("x, cm", 0.5), number("y, cm", 0.5), number("heading, degrees", 5)];
  const fault = element("input", { className: "long", ariaLabel: "fault", placeholder: "drop:p=0.01" });
  fault.setAttribute("list", "fault-names");
  const mouse = button("With the mouse", () => placing(mouse.getAttribute("aria-pressed") !== "true"));
  mouse.setAttribute("aria-pressed", "false");

  function placing(on) {
    mouse.setAttribute("aria-pressed", on);
    document.body.classList.toggle("placing", on);
  }

  function place(px, py, turned) {
    if (what.selectedIndex === 0) wish({ do: "place", x: px, y: py, heading: turned });
    else wish({ do: "push", thing: what.selectedIndex - 1, x: px, y: py });
  }

  at("steering").append(
    group("Run", button("Pause", () => wish({ do: "pause" }), "at once"), button("Go on", () => wish({ do: "resume" })),
      button("Stop", () => wish({ do: "stop" }), "ends the run")),
    group("Plan by", planner, button("Use planner", () => wish({ do: "planner", name: planner.value }))),
    group("Goal", goal, button("Drive to goal", () => wish({ do: "goal", name: goal.value }))),
    group("Place", what, element("label", {}, "x ", x), element("label", {}, "y ", y), " cm",
      element("label", {}, "heading ", heading), "°",
      button("Place", () => {
        if (filled(x, y, heading)) place(x.value / 100, y.value / 100, (heading.value * Math.PI) / 180);
      }), mouse,
      button("At its start", () => wish({ do: "start" })), button("Anywhere", () => wish({ do: "random" }))),
    group("Faults", fault, element("datalist", { id: "fault-names" }, ...FAULTS.map((each) => element("option", { value: each }))),
      button("On", () => filled(fault) && wish({ do: "fault-on", words: fault.value })),
      button("Off", () => filled(fault) && wish({ do: "fault-off", words: fault.value.split(":")[0] }), "all faults of this kind")),
  );
  at("steering").addEventListener("submit", (event) => event.preventDefault());
  new MutationObserver(() => {
    const count = Number(at("arena").dataset.things ?? 0);
    while (what.options.length > count + 1) what.lastChild.remove();
    while (what.options.length < count + 1) what.append(element("option", {}, `thing ${what.options.length - 1}`));
  }).observe(at("arena"), { attributes: true, attributeFilter: ["data-things"] });
  prepareMouse(at("arena"), what, place, placing);
}

// Press where the robot is to stand, draw towards where it is to look, let go. A thing is dragged.
function prepareMouse(arena, what, place, placing) {
  let begin = null;
  let thing = null;
  const where = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(arena.getScreenCTM().inverse());
    return { x: point.x / 1000, y: -point.y / 1000 };
  };
  const draw = (from, to) => {
    const line = `M${1000 * from.x} ${-1000 * from.y}L${1000 * to.x} ${-1000 * to.y}`;
    at("aim-here").innerHTML = `<path d="${line}"/>`;
  };
  arena.addEventListener("pointerdown", (event) => {
    if (!document.body.classList.contains("placing")) return;
    begin = where(event);
    thing = event.target.dataset?.thing ?? null;
    arena.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  arena.addEventListener("pointermove", (event) => begin && draw(begin, where(event)));
  arena.addEventListener("pointerup", (event) => {
    if (!begin) return;
    const end = where(event);
    if (thing !== null) {
      what.selectedIndex = Number(thing) + 1;
      place(end.x, end.y, 0);
    } else {
      what.selectedIndex = 0;
      const far = Math.hypot(end.x - begin.x, end.y - begin.y) > 0.01;
      place(begin.x, begin.y, far ? Math.atan2(end.y - begin.y, end.x - begin.x) : 0);
    }
    begin = null;
    at("aim-here").innerHTML = "";
    placing(false);
  });
}
