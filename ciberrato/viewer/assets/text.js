// Names and texts of others, as the page shows them: nothing unseen in them, and no longer than there is room.

const UNSEEN = /[\p{Cc}\p{Cf}\p{Cs}\p{Zl}\p{Zp}]/gu;
// Joiners make letters and emoji of several signs into one: they hide nothing.
const JOINERS = "\u200c\u200d";

/** Show control characters as a sign: they could turn the text round, or hide a part of it. */
export function plain(text) {
  return text.replace(UNSEEN, (sign) => (JOINERS.includes(sign) ? sign : "\ufffd"));
}

/** Cut a text to at most so many signs, the last of them an ellipsis if something is missing. */
export function clip(text, most) {
  if (text.length <= most) return text;
  const signs = [...text];
  return signs.length <= most ? text : `${signs.slice(0, most - 1).join("").trimEnd()}…`;
}

/** Write a text, cut if it is long, and the whole of it for those who hover. */
export function sayClipped(element, text, most) {
  const short = clip(text, most);
  if (element.textContent !== short) element.textContent = short;
  if (element.title !== text) element.title = text;
}
