// Labels over the picture that keep their size whatever the zoom, each where no other one is.

import { svg } from "./svg.js";
import { clip } from "./text.js";

const GAP = 3;

/** Where a label may stand: below its place, above, to the right, to the left; on it. */
export const AROUND = [[0, 1], [0, -1], [1, 0], [-1, 0]];
export const ON = [[0, 0]];

function apart(a, b) {
  return a[0] >= b[2] || b[0] >= a[2] || a[1] >= b[3] || b[1] >= a[3];
}

/**
 * Find a free box for each label; greedy, in the order given.
 *
 * @param labels  {key, width, height, x, y, reach, choices, needed}: the place on the screen, how far the label keeps from
 *   it, where it may stand, and whether it is shown even over others
 * @param taken   boxes [left, top, right, bottom] that stay free
 * @param before  choices of the last time by key, tried first, so that labels do not jump to and fro; updated
 * @returns boxes, null for a label that has no room
 */
export function arrange(labels, taken, size, before = new Map()) {
  const boxes = [...taken];
  const kept = new Map();
  const placed = labels.map(({ key, width, height, x, y, reach = 0, choices = AROUND, needed = false }) => {
    const box = (choice) => {
      const [dx, dy] = choices[choice];
      const middle = x + dx * (reach + width / 2 + GAP);
      const left = Math.min(size.width - width - GAP, Math.max(GAP, middle - width / 2));
      const top = y + dy * (reach + height / 2 + GAP) - height / 2;
      return [left, top, left + width, top + height];
    };
    const last = Math.min(before.get(key) ?? 0, choices.length - 1);
    const inside = ([, top, , bottom]) => top >= 0 && bottom <= size.height;
    const choice = [last, ...choices.keys()].find((one) => inside(box(one)) && boxes.every((other) => apart(box(one), other)));
    if (choice === undefined && !needed) return null;
    kept.set(key, choice ?? last);
    boxes.push(box(choice ?? last));
    return boxes.at(-1);
  });
  before.clear();
  for (const [key, choice] of kept) before.set(key, choice);
  return placed;
}

/** Labels in pixels: made once, moved often. */
export class Labels {
  constructor(group) {
    this.group = group;
    this.drawn = new Map();
    this.choices = new Map();
    this.widths = new Map();
    this.context = document.createElement("canvas").getContext("2d");
    this.setSize(12, 24);
  }

  /** The height of the letters in pixels, and how many a label has at most. */
  setSize(size, most) {
    if (size === this.size) return;
    this.size = size;
    this.most = most;
    this.widths.clear();
    this.group.style.fontSize = `${size}px`;
    this.context.font = `650 ${size}px ${getComputedStyle(document.body).fontFamily}`;
  }

  width(text) {
    let width = this.widths.get(text);
    if (width === undefined) {
      if (this.widths.size > 2000) this.widths.clear();
      width = this.context.measureText(text).width + 2;
      this.widths.set(text, width);
    }
    return width;
  }

  /** Show labels as for `arrange`, and {text, className, color}; places in pixels. */
  update(labels, taken, size) {
    const sized = labels.map((label) => {
      const short = clip(label.text, this.most);
      return { ...label, short, width: this.width(short), height: this.size * 1.25 };
    });
    const boxes = arrange(sized, taken, size, this.choices);
    const shown = new Set();
    sized.forEach(({ key, text, short, className, color }, index) => {
      const box = boxes[index];
      if (!box) return;
      shown.add(key);
      let element = this.drawn.get(key);
      if (!element) {
        element = svg("text");
        this.drawn.set(key, element);
        this.group.append(element);
      }
      if (element.dataset.text !== `${short}\n${text}`) {
        element.dataset.text = `${short}\n${text}`;
        element.textContent = short;
        // What is cut can be read whole by hovering.
        if (short !== text) {
          const title = svg("title");
          title.textContent = text;
          element.append(title);
        }
        element.dataset.cut = String(short !== text);
      }
      if (element.getAttribute("class") !== className) element.setAttribute("class", className);
      element.setAttribute("transform", `translate(${((box[0] + box[2]) / 2).toFixed(1)} ${((box[1] + box[3]) / 2).toFixed(1)})`);
      element.style.setProperty("--robot", color ?? "currentColor");
    });
    for (const [key, element] of this.drawn) {
      if (!shown.has(key)) {
        element.remove();
        this.drawn.delete(key);
      }
    }
  }
}
