// Keys, mouse, touch.

const PAN = 60;

/** Keys that work everywhere but in fields; the lab's own keys work when it has the focus. */
export function bindKeys(actions) {
  const keys = {
    " ": actions.startOrStop, r: actions.reset, p: actions.play, l: actions.live, f: actions.follow, d: actions.theme, w: actions.project, "?": actions.help,
    ",": () => actions.step(-1), ".": () => actions.step(1), "+": () => actions.zoom(1.25), "=": () => actions.zoom(1.25),
    "-": () => actions.zoom(0.8), 0: actions.fit, Escape: () => actions.choose(null),
    c: () => actions.layer("cones"), t: () => actions.layer("trails"), b: () => actions.layer("belief"), n: () => actions.layer("names"), g: () => actions.layer("starts"),
  };
  for (let digit = 1; digit <= 9; digit += 1) keys[digit] = () => actions.choose(digit);
  const arrows = { ArrowLeft: [PAN, 0], ArrowRight: [-PAN, 0], ArrowUp: [0, PAN], ArrowDown: [0, -PAN] };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const on = event.target;
    if (on.matches("select, input:not([type=range])")) return;
    // A button that has the focus is pressed by the space bar, as everywhere.
    if (event.key === " " && on.matches("button")) return;
    const arrow = on.id === "stage" ? arrows[event.key] : undefined;
    const action = arrow ? () => actions.pan(...arrow) : keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

/** Drag to move, wheel or two fingers to zoom, hover for the cell. */
export function bindPointer(stage, actions) {
  const pointers = new Map();
  let dragged = false;
  const place = (event) => {
    const box = stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  stage.addEventListener("pointerdown", (event) => {
    if (event.target.closest("button") || (event.pointerType === "mouse" && event.button !== 0)) return;
    pointers.set(event.pointerId, place(event));
    if (pointers.size === 1) dragged = false;
  });
  stage.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    const before = pointers.get(event.pointerId);
    if (!before) {
      if (event.pointerType === "mouse") actions.hover(event.target.closest("button") ? null : x, y);
      return;
    }
    if (!dragged && pointers.size === 1 && Math.hypot(x - before[0], y - before[1]) < 4) return;
    if (!dragged) {
      dragged = true;
      stage.classList.add("dragging");
      actions.hover(null, 0);
    }
    // Only now: a press that does not move is a click on what is under it.
    if (!stage.hasPointerCapture(event.pointerId)) stage.setPointerCapture(event.pointerId);
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      const old = Math.hypot(before[0] - other[0], before[1] - other[1]);
      const now = Math.hypot(x - other[0], y - other[1]);
      if (old > 10 && now > 10) actions.zoom(now / old, (x + other[0]) / 2, (y + other[1]) / 2);
      actions.pan((x - before[0]) / 2, (y - before[1]) / 2);
    } else {
      actions.pan(x - before[0], y - before[1]);
    }
    pointers.set(event.pointerId, [x, y]);
  });
  const release = (event) => {
    pointers.delete(event.pointerId);
    if (!pointers.size) stage.classList.remove("dragging");
  };
  stage.addEventListener("pointerup", release);
  stage.addEventListener("pointercancel", release);
  stage.addEventListener("pointerleave", () => actions.hover(null, 0));
  stage.addEventListener("click", (event) => {
    // The end of a drag is not a click on a robot.
    if (dragged && !event.target.closest("button")) {
      event.stopPropagation();
      event.preventDefault();
    }
  }, true);
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    actions.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), ...place(event));
  }, { passive: false });
}
