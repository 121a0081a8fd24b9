"""What of a page is hard to read, in both colour schemes, and whether it is as wide as the screen."""

from __future__ import annotations

import os
from pathlib import Path

from playwright.sync_api import Page

__all__ = ["save", "unreadable"]

# Texts with less than the contrast of WCAG's level AA.
CONTRASTS = """() => {
  const rgb = text => text.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = node => {
    for (; node; node = node.parentElement) {
      const colour = rgb(getComputedStyle(node).backgroundColor);
      if (colour[3] !== 0) return colour;
    }
    return [255, 255, 255];
  };
  const poor = [];
  for (const node of document.querySelectorAll("body *")) {
    const text = [...node.childNodes].filter(n => n.nodeType === 3).map(n => n.data).join("").trim();
    if (!text || !node.checkVisibility({ opacityProperty: true }) || node.closest("[disabled]")) continue;
    const [a, b] = [light(rgb(getComputedStyle(node).color)), light(ground(node))].sort((x, y) => y - x);
    if ((a + 0.05) / (b + 0.05) < 4.5) poor.push(`${text} ${((a + 0.05) / (b + 0.05)).toFixed(2)}`);
  }
  return poor;
}"""
WIDTH = "document.documentElement.scrollWidth"


def save(page: Page, name: str, *, whole: bool = False) -> None:
    """Keep a picture where METAROS_SHOTS says, for people to look at: of what is seen, or of the whole page."""
    if folder := os.environ.get("METAROS_SHOTS"):
        if whole:
            page.evaluate("scrollTo(0, 0)")  # the bar on top sticks where the page is
        page.screenshot(path=str(Path(folder) / f"{name}.png"), full_page=whole)


def unreadable(page: Page, what: str = "", *, shot: str = "", whole: bool = False) -> list[str]:
    """What is wrong with the page as it stands there, light and dark; pictures of both if `shot` names them."""
    assert page.viewport_size is not None
    width, faults = page.viewport_size["width"], []
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        if shot:
            save(page, f"{shot}-{scheme}", whole=whole)
        faults += [f"{what} {scheme}: {text}" for text in page.evaluate(CONTRASTS)]
        if (seen := page.evaluate(WIDTH)) > width:
            faults.append(f"{what} {scheme}: {seen} wide on a screen of {width}")
    return faults
