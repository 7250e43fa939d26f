// What is wrong with the layout of a page: pictures that are missing, text over text, a page wider than the screen.
() => {
  const clip = (element, rectangle) => {
    let { left, right, top, bottom } = rectangle;
    for (let parent = element; parent && parent !== document.body; parent = parent.parentElement) {
      if (getComputedStyle(parent).overflowX === "visible") continue;
      const frame = parent.getBoundingClientRect();
      left = Math.max(left, frame.left);
      right = Math.min(right, frame.right);
      top = Math.max(top, frame.top);
      bottom = Math.min(bottom, frame.bottom);
    }
    return { left, right, top, bottom };
  };

  const boxes = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    if (!node.data.trim() || node.parentElement.closest("script, style")) continue;
    const parent = node.parentElement;
    if (!parent.checkVisibility({ visibilityProperty: true })) continue; // also within closed details
    if (parent.matches("details:not([open])")) continue; // text of their own, beside the summary
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const rectangle of range.getClientRects()) {
      const box = clip(node.parentElement, rectangle);
      if (box.right - box.left > 2 && box.bottom - box.top > 2) boxes.push({ ...box, node, text: node.data.trim() });
    }
  }
  boxes.sort((a, b) => a.top - b.top);
  const overlaps = [];
  for (let first = 0; first < boxes.length; first++) {
    const a = boxes[first];
    for (let second = first + 1; second < boxes.length && boxes[second].top < a.bottom - 3; second++) {
      const b = boxes[second];
      const width = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const height = Math.min(a.bottom, b.bottom) - b.top;
      if (a.node !== b.node && width > 2 && height > 3) overlaps.push(`${a.text.slice(0, 40)} | ${b.text.slice(0, 40)}`);
    }
  }
  const shown = [...document.images].filter((image) => image.getClientRects().length);
  return {
    texts: boxes.length,
    overlaps,
    missing: shown.filter((image) => !image.complete || !image.naturalWidth).map((image) => image.src.slice(0, 200)),
    wide: document.documentElement.scrollWidth > innerWidth + 1,
    empty: [...document.querySelectorAll("h2, h3")].filter((heading) => {
      const next = heading.nextElementSibling ?? heading.closest("div.output_area, div.cell")?.nextElementSibling;
      return !next || (next.matches("h2") && heading.matches("h2"));
    }).map((heading) => heading.textContent),
  };
};
