"""`python -m benchmarks.view`: how soon the page of `pcjax view` answers, in a headless Chromium,
and whether its memory grows over a thousand moves. Linux only, for the memory.

Times are the browser's own: from the pointer's last event to the change that it makes on the page.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.browser import Visitor, browser, page_served

_WATCH = """
() => {
  window.seen = {drawn: [], first: [], refined: []};
  let moved = 0, dropped = 0, first = false;
  const now = () => performance.now();
  const on = (name, act) => document.addEventListener(name, act, true);
  on('pointermove', (e) => { if (e.buttons && !moved) moved = now(); });
  on('pointerup', () => { dropped = now(); first = true; moved = 0; });
  const limbs = document.querySelector('[data-testid=hand-does]');
  new MutationObserver(() => {
    if (moved) { seen.drawn.push(now() - moved); moved = 0; }
  }).observe(limbs, {subtree: true, childList: true, attributes: true});
  const about = document.querySelector('[data-testid=about]');
  const card = document.querySelector('.numbers');
  new MutationObserver(() => {
    if (!dropped || card.classList.contains('stale')) return;
    if (first) { seen.first.push(now() - dropped); first = false; }
    if (about.textContent.startsWith('5,000')) { seen.refined.push(now() - dropped); dropped = 0; }
  }).observe(card, {subtree: true, childList: true, characterData: true, attributes: true});
}
"""

_KINDS = {
    "drawn": "a move is drawn",
    "first": "first numbers after a drop (200 trials)",
    "refined": "refined ones (5,000 trials a direction)",
}


def resident(process: int) -> float:
    """Memory of a process, MB."""
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def main() -> None:
    """Prints two tables."""
    parser = argparse.ArgumentParser(description="How soon the page answers.")
    parser.add_argument("--drops", type=int, default=40)
    parser.add_argument("--moves", type=int, default=1000)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    with (
        tempfile.TemporaryDirectory() as folder,
        browser() as chromium,
        page_served(Path(folder)) as served,
    ):
        me = Visitor(chromium, served.address)
        me.page.evaluate(_WATCH)
        for _ in range(arguments.drops):
            me.drag("fingertip-1", *rng.uniform(-6, 6, 2))
            me.refined()
        print(f"{'milliseconds, ' + str(arguments.drops) + ' drops':45}  median   95 %   most")
        seen = me.page.evaluate("seen")
        for kind, words in _KINDS.items():
            one = np.array(seen[kind])
            low, high = np.percentile(one, [50, 95])
            print(f"{words:45}{low:8.0f}{high:7.0f}{one.max():7.0f}")
        me.drag("fingertip-1", 0, 0, hold=True)
        x, y = me.middle("fingertip-1")
        print("\nmoves   memory of the server, MB")
        for k in range(arguments.moves + 1):
            if k % (arguments.moves // 5) == 0:
                print(f"{k:5}   {resident(served.process):.1f}", flush=True)
            me.page.mouse.move(x + rng.uniform(-8, 8), y + rng.uniform(-8, 8))
            me.page.wait_for_timeout(50)
        me.page.mouse.up()
        me.well()


if __name__ == "__main__":
    sys.exit(main())
