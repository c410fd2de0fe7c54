// In place of the connection to a viewer process: a recording, named in the address: play.html?run=NAME.

const UNITS = [1000, 1000, 10];

/** Numbers from their differences. */
function sums(differences) {
  let sum = 0;
  return differences.map((difference) => (sum += difference));
}

/** The frames of a recording, as the viewer process sends them. */
function framesOf({ times, phases, robots }) {
  const moves = robots.map((robot) => robot.moves.map((row, kind) => sums(row).map((value) => value / UNITS[kind])));
  const changes = robots.map(() => 0);
  let phase = 0;
  return sums(times).map((time, at) => {
    while (phase + 1 < phases.length && phases[phase + 1][0] <= at) phase += 1;
    const rows = [];
    robots.forEach((robot, index) => {
      const own = at - robot.first;
      if (own < 0 || own >= moves[index][0].length) return;
      while (changes[index] + 1 < robot.changes.length && robot.changes[changes[index] + 1][0] <= at) changes[index] += 1;
      const [, ...rest] = robot.changes[changes[index]];
      rows.push([robot.id, moves[index][0][own], moves[index][1][own], moves[index][2][own], ...rest]);
    });
    return [time, phases[phase][1], rows];
  });
}

export class Socket {
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.frames = [];
    this.marks = [];
    window.ciberratoRecording = (recording) => this.show(recording);
    const name = new URLSearchParams(location.search).get("run") ?? "";
    if (!/^[a-z0-9-]+$/.test(name)) return;
    const script = document.createElement("script");
    script.src = `recordings/${name}.js`;
    script.onerror = () => onMessage({ type: "status", connection: "recording", simulator: "no recording of this run" });
    // When the page is ready to ask for frames.
    setTimeout(() => document.head.append(script));
  }

  show(recording) {
    this.frames = framesOf(recording);
    this.marks = recording.marks;
    this.onState(true);
    for (const message of recording.news) {
      if (message.epoch !== undefined) this.epoch = message.epoch;
      this.onMessage(message);
    }
    if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) document.getElementById("play").click();
  }

  send(message) {
    if (message.ask === "frames") this.onMessage({ type: "frames", epoch: this.epoch, frames: this.frames });
    if (message.ask === "marks") this.onMessage({ type: "marks", epoch: this.epoch, skip: message.skip, marks: this.marks.slice(message.skip) });
  }
}
