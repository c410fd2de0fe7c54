// What is painted on the canvas between floor and walls: the belief as a heat map, and trails.

import { canvasColor } from "./svg.js";

// Each ramp rises evenly in lightness against its floor; the first entry is transparent.
const RAMPS = {
  light: [[255, 244, 214, 0], [255, 224, 150, 150], [249, 165, 84, 205], [222, 87, 66, 225], [158, 32, 82, 235], [78, 10, 66, 245]],
  dark: [[44, 24, 84, 0], [70, 30, 112, 150], [134, 38, 122, 205], [209, 69, 98, 225], [246, 146, 77, 238], [253, 240, 168, 248]],
};

/** 256 colours of a ramp, as r, g, b, a. */
export function rampTable(theme) {
  const stops = RAMPS[theme];
  const table = new Uint8ClampedArray(1024);
  for (let i = 0; i < 256; i += 1) {
    const place = (i / 255) * (stops.length - 1);
    const at = Math.min(stops.length - 2, Math.floor(place));
    for (let c = 0; c < 4; c += 1) table[4 * i + c] = stops[at][c] + (stops[at + 1][c] - stops[at][c]) * (place - at);
  }
  return table;
}

/** Turn a belief as sent into one with its cells, row 0 at the bottom. */
export function readBelief(sent) {
  const bytes = Uint8Array.from(atob(sent.cells), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const levels = new Float32Array(sent.rows * sent.columns);
  for (let i = 0; i < levels.length; i += 1) levels[i] = view.getUint16(2 * i, true) / 65535;
  return { ...sent, levels };
}

/** The probability of a cell of a belief. */
export function probability(belief, row, column) {
  const level = belief.levels[row * belief.columns + column];
  return belief.peak * level * level;
}

/** Left, bottom, right and top of a belief's grid. */
export function extent(belief, lab) {
  return belief.extent ?? [0, 0, lab.width, lab.height];
}

/** The name of a cell: its centre in units, as everywhere in this project. */
export function cellName(belief, lab, row, column) {
  const [left, bottom, right, top] = extent(belief, lab);
  const x = left + (column + 0.5) * (right - left) / belief.columns;
  const y = bottom + (row + 0.5) * (top - bottom) / belief.rows;
  return `(${Number(x.toFixed(2))}, ${Number(y.toFixed(2))})`;
}

/** The cell of a belief that a place is in, as [row, column]; null beside the grid. */
export function cellAt(belief, lab, x, y) {
  const [left, bottom, right, top] = extent(belief, lab);
  const column = Math.floor((x - left) / (right - left) * belief.columns);
  const row = Math.floor((y - bottom) / (top - bottom) * belief.rows);
  return row >= 0 && row < belief.rows && column >= 0 && column < belief.columns ? [row, column] : null;
}

export class Paint {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.image = document.createElement("canvas");
    this.imageOf = null;
    this.ramp = null;
    this.theme = "";
  }

  resize(width, height) {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    this.ratio = ratio;
    this.canvas.width = Math.max(1, Math.round(width * ratio));
    this.canvas.height = Math.max(1, Math.round(height * ratio));
  }

  setTheme(theme) {
    this.theme = theme;
    this.ramp = rampTable(theme);
    this.imageOf = null;
  }

  draw(camera, { lab, belief, trails }) {
    const { context } = this;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, camera.width, camera.height);
    if (belief && lab) this.drawBelief(camera, lab, belief);
    for (const trail of trails) this.drawTrail(camera, trail);
  }

  drawBelief(camera, lab, belief) {
    if (this.imageOf !== belief) {
      const { rows, columns, levels } = belief;
      this.image.width = columns;
      this.image.height = rows;
      const context = this.image.getContext("2d");
      const pixels = context.createImageData(columns, rows);
      for (let row = 0; row < rows; row += 1) {
        for (let column = 0; column < columns; column += 1) {
          const color = 4 * Math.round(255 * levels[row * columns + column]);
          const at = 4 * ((rows - 1 - row) * columns + column);
          for (let c = 0; c < 4; c += 1) pixels.data[at + c] = this.ramp[color + c];
        }
      }
      context.putImageData(pixels, 0, 0);
      this.imageOf = belief;
    }
    const [left, bottom, right, top] = extent(belief, lab);
    const [x0, y0] = camera.toScreen(left, top);
    const [x1, y1] = camera.toScreen(right, bottom);
    this.context.imageSmoothingEnabled = false;
    this.context.drawImage(this.image, x0, y0, x1 - x0, y1 - y0);
  }

  drawTrail(camera, { id, points }) {
    if (points.length < 4) return;
    const { context } = this;
    context.strokeStyle = canvasColor(id);
    context.lineWidth = Math.max(1.5, Math.min(4, camera.k * 0.09));
    context.lineJoin = "round";
    context.lineCap = "round";
    // Older parts are fainter; four strokes are enough to look even.
    const parts = 4;
    const count = points.length / 2;
    for (let part = 0; part < parts; part += 1) {
      const from = Math.floor((count - 1) * part / parts);
      const to = Math.floor((count - 1) * (part + 1) / parts);
      if (to <= from) continue;
      context.globalAlpha = 0.16 + 0.5 * (part + 1) / parts;
      context.beginPath();
      for (let i = from; i <= to; i += 1) {
        const [x, y] = camera.toScreen(points[2 * i], points[2 * i + 1]);
        if (i === from) context.moveTo(x, y);
        else context.lineTo(x, y);
      }
      context.stroke();
    }
    context.globalAlpha = 1;
  }
}
