// Which part of the lab is seen: (x, y) of the middle in units, and pixels a unit.

const LEAST = 4;
const GREATEST = 400;

export class Camera {
  constructor() {
    this.x = 14;
    this.y = 7;
    this.k = 20;
    this.width = 1;
    this.height = 1;
    this.fitted = true;
    this.lab = { width: 28, height: 14 };
    // Pixels that buttons and legend take from the lab.
    this.insets = { top: 56, bottom: 40, side: 12 };
  }

  resize(width, height) {
    this.width = width;
    this.height = height;
    if (this.fitted) this.fit();
  }

  setLab(lab) {
    this.lab = lab;
    this.fit();
  }

  /** Show the whole lab, clear of the buttons above it and the legend below. */
  fit() {
    const { top, bottom, side } = this.insets;
    const { width, height } = this.lab;
    this.k = Math.max(1, Math.min((this.width - 2 * side) / (width + 0.4), (this.height - top - bottom) / (height + 0.4)));
    this.x = width / 2;
    this.y = height / 2 + (top - bottom) / 2 / this.k;
    this.fitted = true;
  }

  toScreen(x, y) {
    return [(x - this.x) * this.k + this.width / 2, (this.y - y) * this.k + this.height / 2];
  }

  toWorld(px, py) {
    return [(px - this.width / 2) / this.k + this.x, this.y - (py - this.height / 2) / this.k];
  }

  /** Zoom about a point of the screen, which stays where it is. */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.k = Math.min(GREATEST, Math.max(LEAST, this.k * factor));
    this.x = x - (px - this.width / 2) / this.k;
    this.y = y + (py - this.height / 2) / this.k;
    this.fitted = false;
    this.keepInSight();
  }

  pan(dx, dy) {
    this.x -= dx / this.k;
    this.y += dy / this.k;
    this.fitted = false;
    this.keepInSight();
  }

  /** Move towards a place, part of the way. */
  approach(x, y, part) {
    this.x += (x - this.x) * part;
    this.y += (y - this.y) * part;
    this.fitted = false;
  }

  keepInSight() {
    this.x = Math.min(this.lab.width, Math.max(0, this.x));
    this.y = Math.min(this.lab.height, Math.max(0, this.y));
  }

  get transform() {
    return `translate(${this.width / 2 - this.x * this.k} ${this.height / 2 + this.y * this.k}) scale(${this.k} ${-this.k})`;
  }
}
