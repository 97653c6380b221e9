"""Measures of the page in the browser: the contrast of text, and widgets that cover each other."""

from __future__ import annotations

from typing import Final

CONTRAST: Final = """
const parse = (text) => {
  const n = text.match(/[\\d.]+/g).map(Number); return n.length > 3 ? n : [...n, 1]; };
const over = (top, below) => {
  const a = top[3]; return [0, 1, 2].map((i) => top[i] * a + below[i] * (1 - a)).concat(1); };
const light = (c) => { const l = c.slice(0, 3).map((v) => (v /= 255) <= 0.04045 ? v / 12.92
  : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * l[0] + 0.7152 * l[1] + 0.0722 * l[2]; };
const found = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const element = walker.currentNode.parentElement, words = walker.currentNode.textContent.trim();
  const box = element.getBoundingClientRect();
  const seen = {opacityProperty: true, visibilityProperty: true};
  if (!words || !element.checkVisibility(seen) || !box.width) continue;
  if (element.closest('[disabled], .disabled, script, style, canvas, .q-icon')) continue;
  const layers = []; let opacity = 1;
  for (let each = element; each; each = each.parentElement) {
    const style = getComputedStyle(each);
    layers.push(parse(style.backgroundColor));
    opacity *= Number(style.opacity);
  }
  let back = [255, 255, 255, 1];
  if (document.body.classList.contains('body--dark')) back = [18, 18, 18, 1];
  for (const layer of layers.reverse()) back = over(layer, back);
  const color = parse(getComputedStyle(element).color); color[3] *= opacity;
  const text = over(color, back), [a, b] = [light(text), light(back)].sort((x, y) => y - x);
  found.push([words.slice(0, 40), (a + 0.05) / (b + 0.05)]);
}
return found;
"""
"""The text of the page that is not disabled, and the contrast of each piece with what is behind it."""
COVERED: Final = """
const all = [...document.querySelectorAll('button, .q-slider, canvas, .rq-axis, [data-testid]')];
const seen = {opacityProperty: true, visibilityProperty: true};
const wanted = all.filter((each) => each.checkVisibility(seen) && !each.closest('.q-tooltip, .q-dialog'));
const found = [];
for (const each of wanted) {
  each.scrollIntoView({block: 'nearest'});
  const box = each.getBoundingClientRect();
  if (box.width < 2 || box.height < 2) continue;
  for (const [x, y] of [[0.5, 0.5], [0.5, 0.1], [0.5, 0.9], [0.1, 0.5], [0.9, 0.5]]) {
    const px = box.left + x * box.width, py = box.top + y * box.height;
    if (px < 0 || py < 0 || px >= innerWidth || py >= innerHeight) continue;
    const top = document.elementFromPoint(px, py);
    if (top && !each.contains(top) && !top.contains(each))
      found.push(`${each.dataset.testid || each.className} under ${top.dataset.testid || top.className}`);
  }
}
return [...new Set(found)];
"""
"""Widgets of which another one covers a part, once they have been scrolled to."""
WIDE: Final = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
"""How far the page stands out to the side, in pixels."""
