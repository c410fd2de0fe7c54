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

const COLORS = 8;

/** The colour of a robot by its id, as a custom property: light and dark have their own. */
export function robotColor(id) {
  return `var(--robot-${(((id || 1) - 1) % COLORS + COLORS) % COLORS})`;
}

/** The same as a colour that a canvas takes. */
export function canvasColor(id) {
  return getComputedStyle(document.documentElement).getPropertyValue(robotColor(id).slice(4, -1));
}
