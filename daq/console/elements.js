// Elements of the page by their ids.

/**
 * Returns the element with an id; throws an error where the page has none of this type.
 *
 * @template {HTMLElement} [T=HTMLElement]
 * @overload
 * @param {string} id
 * @param {new () => T} [type]
 * @returns {T}
 */
/**
 * @param {string} id
 * @param {new () => HTMLElement} type
 */
export function element(id, type = HTMLElement) {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new TypeError(`#${id} is no ${type.name}`);
  return found;
}

/**
 * Returns whether a key event belongs to a text field or is a shortcut of the browser.
 *
 * @param {KeyboardEvent} event
 */
export function isTyping(event) {
  const isField = event.target instanceof Element && event.target.matches("input, textarea");
  return isField || event.ctrlKey || event.metaKey || event.altKey;
}

/**
 * Returns the elements that match a selector.
 *
 * @param {string} selector
 * @param {ParentNode} parent
 * @returns {NodeListOf<HTMLElement>}
 */
export function elements(selector, parent = document) {
  return parent.querySelectorAll(selector);
}
