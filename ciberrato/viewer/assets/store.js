// The frames that this page has, by time. The viewer process has the whole run; what is missing is asked for.

const MOST_ROBOT_FRAMES = 400000;

/** Turn a frame as sent into an object. */
export function readFrame([time, phase, rows]) {
  return {
    time,
    phase,
    robots: rows.map(([id, x, y, dir, score, arrival, returning, collisions, hit, mask, state]) => (
      { id, x, y, dir, score, arrival, returning, collisions, hit: hit === 1, mask, state })),
  };
}

export class Store {
  constructor() {
    this.clear();
  }

  clear() {
    this.times = [];
    this.frames = [];
    this.size = 0;
  }

  get first() {
    return this.times.length ? this.times[0] : 0;
  }

  get last() {
    return this.times.length ? this.times[this.times.length - 1] : 0;
  }

  /** Put a frame where it belongs; one of the same time is replaced. */
  insert(frame) {
    const at = this.floor(frame.time);
    if (at >= 0 && this.times[at] === frame.time) {
      this.frames[at] = frame;
      return;
    }
    if (at === this.times.length - 1) {
      this.times.push(frame.time);
      this.frames.push(frame);
    } else {
      this.times.splice(at + 1, 0, frame.time);
      this.frames.splice(at + 1, 0, frame);
    }
    this.size += frame.robots.length || 1;
    if (this.size > MOST_ROBOT_FRAMES) this.thin();
  }

  /** Index of the last frame that is not later than a time, -1 if there is none. */
  floor(time) {
    let low = 0;
    let high = this.times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** Whether frames are missing around a time. */
  gapAt(time) {
    const at = this.floor(time);
    if (at < 0) return this.times.length > 0 ? this.times[0] > time : true;
    return at + 1 < this.times.length ? this.times[at + 1] - this.times[at] > 1 && this.times[at] !== time : false;
  }

  thin() {
    const half = this.times.length >> 1;
    const keep = (_, index) => index >= half || index % 2 === 0;
    this.times = this.times.filter(keep);
    this.frames = this.frames.filter(keep);
    this.size = this.frames.reduce((sum, frame) => sum + (frame.robots.length || 1), 0);
  }
}

/** The shortest way from one direction to another, in degrees. */
function turn(from, to) {
  return ((to - from + 540) % 360 + 360) % 360 - 180;
}

/** Robots between two frames; a part of 0 gives the first, of 1 the second. What jumps is not smoothed. */
export function between(before, after, part) {
  if (!before || part >= 1) return after.robots;
  const old = new Map(before.robots.map((robot) => [robot.id, robot]));
  return after.robots.map((robot) => {
    const from = old.get(robot.id);
    if (!from || from.x === null || robot.x === null) return robot;
    const dx = robot.x - from.x;
    const dy = robot.y - from.y;
    if (dx * dx + dy * dy > 1) return robot;
    return { ...robot, x: from.x + dx * part, y: from.y + dy * part, dir: from.dir + turn(from.dir, robot.dir) * part };
  });
}
