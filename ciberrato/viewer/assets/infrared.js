// What an IR sensor sees, by the rule of the simulator: the least of three rays and of the corners in the cone.

export const SENSOR_OFFSET = 0.5;
export const HALF_APERTURE = Math.PI / 6;
const ROBOT_RADIUS = 0.5;

/** Faces and corners of everything that reflects: walls higher than 0 and the border. */
export function reflectors(lab) {
  const { width: w, height: h } = lab;
  const polygons = [[0, 0, w, 0, w, h, 0, h], ...lab.walls.filter(([height]) => height > 0).map(([, flat]) => flat)];
  const faces = [];
  const corners = new Map();
  for (const flat of polygons) {
    for (let i = 0; i < flat.length; i += 2) {
      const j = (i + 2) % flat.length;
      faces.push([flat[i], flat[i + 1], flat[j], flat[j + 1]]);
      corners.set(`${flat[i]},${flat[i + 1]}`, [flat[i], flat[i + 1]]);
    }
  }
  return { faces, corners: [...corners.values()] };
}

/** Distance along a ray to the nearest face; Infinity if there is none. */
function ray(faces, x, y, angle) {
  const dx = Math.cos(angle);
  const dy = Math.sin(angle);
  let best = Infinity;
  for (const [x0, y0, x1, y1] of faces) {
    const ex = x1 - x0;
    const ey = y1 - y0;
    const cross = dx * ey - dy * ex;
    if (cross === 0) continue;
    const along = ((x0 - x) * ey - (y0 - y) * ex) / cross;
    const part = ((x0 - x) * dy - (y0 - y) * dx) / cross;
    if (along >= 0 && along < best && part >= -1e-12 && part <= 1 + 1e-12) best = along;
  }
  return best;
}

/**
 * What a sensor of a robot sees.
 *
 * @returns {{distance: number, x: number, y: number, fromX: number, fromY: number}} the distance, the point that
 *   it was measured to, and where the sensor is
 */
export function look(scene, robot, direction, others = []) {
  const fromX = robot.x + SENSOR_OFFSET * Math.cos(direction);
  const fromY = robot.y + SENSOR_OFFSET * Math.sin(direction);
  const seen = { distance: Infinity, x: fromX, y: fromY, fromX, fromY };
  const take = (distance, x, y) => {
    if (distance < seen.distance) Object.assign(seen, { distance, x, y });
  };
  for (const side of [0, HALF_APERTURE, -HALF_APERTURE]) {
    const distance = ray(scene.faces, fromX, fromY, direction + side);
    take(distance, fromX + distance * Math.cos(direction + side), fromY + distance * Math.sin(direction + side));
  }
  for (const [x, y] of scene.corners) {
    const distance = Math.hypot(x - fromX, y - fromY);
    if (distance < seen.distance && Math.abs(apart(Math.atan2(y - fromY, x - fromX), direction)) <= HALF_APERTURE + 1e-12) {
      take(distance, x, y);
    }
  }
  for (const other of others) {
    if (other.id === robot.id || other.state === "Removed" || other.x === null) continue;
    const point = seeRobot(fromX, fromY, direction, other);
    if (point) take(...point);
  }
  return seen;
}

function apart(a, b) {
  return Math.atan2(Math.sin(a - b), Math.cos(a - b));
}

/** Another robot in the cone: fully inside it, or reaching over its edge. */
function seeRobot(x, y, direction, other) {
  const distance = Math.hypot(other.x - x, other.y - y);
  const bearing = Math.atan2(other.y - y, other.x - x);
  const off = Math.abs(apart(bearing, direction));
  if (distance <= ROBOT_RADIUS) return [0, x, y];
  if (off <= HALF_APERTURE) {
    const length = distance - ROBOT_RADIUS;
    return [length, x + length * Math.cos(bearing), y + length * Math.sin(bearing)];
  }
  const beyond = off - HALF_APERTURE;
  if (beyond > Math.asin(ROBOT_RADIUS / distance)) return null;
  // Along the cone's edge to the circle.
  const across = distance * Math.sin(beyond);
  const length = distance * Math.cos(beyond) - Math.sqrt(Math.max(0, ROBOT_RADIUS ** 2 - across ** 2));
  const edge = direction + Math.sign(apart(bearing, direction)) * HALF_APERTURE;
  return [length, x + length * Math.cos(edge), y + length * Math.sin(edge)];
}
