// Figures of torques over time: Bokeh draws them; this script holds the samples, and draws of them what the window shows.
"use strict";
(() => {
  const PIXEL = 0.6; // half of the least height of a bin [pixels]
  const MOST_BINS = 7000; // in all panels: more take longer than 100 ms to draw

  const decode = (text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);

  // Least and greatest value of each bin of `width` entries, from the bin that holds `first` to the one that holds
  // `last`. A bin also holds the first entry of the next one, so that areas touch each other and no peak is lost.
  function envelope(low, high, width, first, last) {
    const begin = Math.floor(first / width);
    const count = Math.floor(last / width) - begin + 1;
    const ends = { begin, low: new Float64Array(count), high: new Float64Array(count) };
    for (let bin = 0; bin < count; bin++) {
      const start = (begin + bin) * width;
      const stop = Math.min(start + width + 1, low.length);
      let least = low[start];
      let greatest = high[start];
      for (let entry = start + 1; entry < stop; entry++) {
        if (low[entry] < least) least = low[entry];
        if (high[entry] > greatest) greatest = high[entry];
      }
      ends.low[bin] = least;
      ends.high[bin] = greatest;
    }
    return ends;
  }

  // Entries of a trace that the window shows, and one more at either side; null where there is none.
  function visible(trace, range) {
    const first = Math.max(0, Math.floor((range.start - trace.start) / trace.step));
    const last = Math.min(trace.low.length - 1, Math.ceil((range.end - trace.start) / trace.step));
    return first <= last ? [first, last] : null;
  }

  // Draw a trace: its samples as a line where there is a pixel for each of them, else a rectangle for each bin. A bin is
  // a pixel wide, and up to three where many traces are shown.
  function drawTrace(trace, range, share) {
    const entries = visible(trace, range);
    const { line, area, plot } = trace;
    if (entries === null) {
      line.visible = area.visible = false;
      return;
    }
    const [first, last] = entries;
    const pixels = Math.max(100, plot.inner_width ?? 0);
    line.visible = trace.low === trace.high && last - first <= pixels;
    area.visible = !line.visible;
    if (line.visible) {
      const x = Float64Array.from({ length: last - first + 1 }, (_, entry) => trace.start + (first + entry) * trace.step);
      line.data_source.data = { x, y: trace.low.slice(first, last + 1) };
      return;
    }
    const bins = Math.min(pixels, Math.max(pixels / 3, share));
    const width = Math.max(1, Math.ceil((last - first) / bins));
    const { begin, low, high } = envelope(trace.low, trace.high, width, first, last);
    const margin = (PIXEL * (plot.y_range.end - plot.y_range.start)) / Math.max(50, plot.inner_height ?? 0);
    const left = Float64Array.from(low, (_, bin) => trace.start + (begin + bin) * width * trace.step);
    const right = left.map((time) => time + width * trace.step);
    area.data_source.data = { left, right, low: low.map((value) => value - margin), high: high.map((value) => value + margin) };
  }

  function draw(figure) {
    const [shown, hidden] = [true, false].map((checked) =>
      figure.series.filter(({ input }) => input.checked === checked).flatMap(({ traces }) => traces)
    );
    for (const trace of shown) drawTrace(trace, figure.range, MOST_BINS / shown.length);
    for (const trace of hidden) trace.line.visible = trace.area.visible = false;
  }

  // Both ends of a window change one after the other; it is drawn once, before the browser paints.
  function schedule(figure) {
    if (figure.scheduled) return;
    figure.scheduled = true;
    queueMicrotask(() => {
      figure.scheduled = false;
      draw(figure);
    });
  }

  // Values of all series at a time, in the cells of the table; empty without a time.
  function readValues(figure, time) {
    figure.time.textContent = time === null ? "" : `at ${time.toFixed(3)} s`;
    for (const { traces } of figure.series) {
      for (const trace of traces) {
        const place = (time - trace.start) / trace.step;
        const entry = trace.low === trace.high ? Math.round(place) : Math.floor(place);
        if (time === null || entry < 0 || entry >= trace.low.length) trace.cell.textContent = "";
        else {
          const ends = trace.low === trace.high ? [trace.low[entry]] : [trace.low[entry], trace.high[entry]];
          trace.cell.textContent = ends.map((value) => value.toFixed(3)).join(" … ");
        }
      }
    }
  }

  function readSeries(element, data, find) {
    return data.series.map(({ traces }, number) => ({
      input: element.querySelector(`input[data-series="${number}"]`),
      traces: traces.map(({ torque, start, step, low, high }) => {
        const samples = decode(low);
        return {
          start,
          step,
          low: samples,
          high: high === null ? samples : decode(high),
          line: find(`${torque} ${number} line`),
          area: find(`${torque} ${number} area`),
          plot: find(torque),
          cell: element.querySelector(`td[data-series="${number}"][data-torque="${torque}"]`),
        };
      }),
    }));
  }

  async function show(element) {
    const data = JSON.parse(element.querySelector("script").textContent);
    element.hidden = false;
    await Bokeh.embed.embed_item(data.figure, element.querySelector(".panels"));
    const find = (name) => Bokeh.documents.at(-1).get_model_by_name(name);
    const plots = data.torques.map(find);
    const range = plots[0].x_range;
    const figure = { range, plots, time: element.querySelector(".time") };
    figure.series = readSeries(element, data, find);
    for (const signal of [range.properties.start.change, range.properties.end.change]) {
      signal.connect(() => schedule(figure));
    }
    for (const plot of plots) {
      plot.properties.inner_width.change.connect(() => schedule(figure));
      for (const signal of [plot.y_range.properties.start.change, plot.y_range.properties.end.change]) {
        signal.connect(() => schedule(figure));
      }
      plot.on_event("mousemove", (event) => readValues(figure, event.x));
      plot.on_event("tap", (event) => readValues(figure, event.x));
      plot.on_event("mouseleave", () => readValues(figure, null));
    }
    for (const { input } of figure.series) input.addEventListener("change", () => schedule(figure));
    for (const button of element.querySelectorAll("button")) {
      const [start, end] = button.dataset.window.split(" ").map(Number);
      button.addEventListener("click", () => range.setv({ start, end }));
    }
    draw(figure);
    ankleloop.figures.push(figure);
    document.body.classList.add("interactive");
  }

  globalThis.ankleloop = { envelope, figures: [] };
  for (const element of document.querySelectorAll("figure.interactive")) {
    show(element).catch((error) => {
      element.hidden = true; // the static figure stays
      throw error;
    });
  }
})();
