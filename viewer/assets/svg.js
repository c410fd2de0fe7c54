// Making SVG elements, and the colours of robots.

const SVG = "http://www.w3.org/2000/svg";

/** Make an SVG element with attributes and children. */
export function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** Make an HTML element; text only ever goes in as text. */
export function html(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

/** Write text where it differs, so that nothing is laid out again without need. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Eight colours that colour-blind people tell apart; the number on each robot says the rest.
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#b5488f", "#4d9fd6", "#c98a00", "#7a5fc0", "#5d6b73"];

/** The colour of a robot by its id. */
export function robotColor(id) {
  return COLORS[(((id || 1) - 1) % COLORS.length + COLORS.length) % COLORS.length];
}
