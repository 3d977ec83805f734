// Curves on a canvas, redrawn from scratch for every picture: axes, grid, lines, one marker.
// A plotting library was too slow for that on a small machine; the reports use one.
"use strict";

const MARGIN = { left: 58, right: 12, top: 22, bottom: 40 };

class Plot {
  constructor(canvas, xTitle, yTitle) {
    this.canvas = canvas;
    this.titles = [xTitle, yTitle];
    this.ranges = null; // grow with the data, so that the picture stands still
  }

  // curves: [{ name, x, y, colour, width, dash }], the legend has those with a name; marker: [x, y] or null
  draw(curves, marker, colours) {
    const { canvas } = this, scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
    if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.grow(curves);
    const [[x0, x1], [y0, y1]] = this.ranges;
    const toX = (x) => MARGIN.left + (x - x0) / (x1 - x0) * (width - MARGIN.left - MARGIN.right);
    const toY = (y) => height - MARGIN.bottom - (y - y0) / (y1 - y0) * (height - MARGIN.top - MARGIN.bottom);
    this.axes(pen, toX, toY, width, height, colours);
    curves.forEach((curve) => {
      pen.strokeStyle = curve.colour;
      pen.lineWidth = curve.width;
      pen.setLineDash(curve.dash ? [7, 5] : []);
      pen.beginPath();
      curve.x.forEach((x, place) => {
        const y = curve.y[place];
        if (y !== null) pen.lineTo(toX(x), toY(y));
      });
      pen.stroke();
    });
    pen.setLineDash([]);
    if (marker && marker[1] !== null) {
      pen.fillStyle = colours.marker;
      pen.beginPath();
      pen.arc(toX(marker[0]), toY(marker[1]), 6, 0, 7);
      pen.fill();
    }
    this.legend(pen, curves, colours);
  }

  grow(curves) {
    const extent = (lists) => {
      let low = Infinity, high = -Infinity;
      for (const list of lists) for (const value of list) {
        if (value === null) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
      return low < high ? [low, high] : [low - 1, low + 1];
    };
    const wanted = [extent(curves.map((one) => one.x)), extent(curves.map((one) => one.y))];
    if (!wanted.flat().every(Number.isFinite)) { this.ranges = this.ranges || [[-1, 1], [-1, 1]]; return; }
    this.ranges = wanted.map(([low, high], axis) => {
      const before = this.ranges ? this.ranges[axis] : [Infinity, -Infinity];
      const room = 0.05 * (high - low);
      return [low < before[0] ? low - room : before[0], high > before[1] ? high + room : before[1]];
    });
  }

  axes(pen, toX, toY, width, height, colours) {
    pen.font = "12px system-ui, sans-serif";
    pen.lineWidth = 1;
    this.ranges.forEach(([low, high], axis) => {
      const step = niceStep((high - low) / (axis ? 6 : 8));
      for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) {
        const zero = Math.abs(tick) < step / 1e6;
        pen.strokeStyle = zero ? colours.soft : colours.line;
        pen.fillStyle = colours.ink;
        pen.beginPath();
        if (axis) { pen.moveTo(MARGIN.left, toY(tick)); pen.lineTo(width - MARGIN.right, toY(tick)); }
        else { pen.moveTo(toX(tick), MARGIN.top); pen.lineTo(toX(tick), height - MARGIN.bottom); }
        pen.stroke();
        const text = String(zero ? 0 : +tick.toPrecision(6));
        pen.textAlign = axis ? "right" : "center";
        if (axis) pen.fillText(text, MARGIN.left - 6, toY(tick) + 4);
        else pen.fillText(text, toX(tick), height - MARGIN.bottom + 16);
      }
    });
    pen.textAlign = "center";
    pen.fillText(this.titles[0], (MARGIN.left + width - MARGIN.right) / 2, height - 6);
    pen.save();
    pen.translate(13, height / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(this.titles[1], 0, 0);
    pen.restore();
  }

  legend(pen, curves, colours) {
    let x = MARGIN.left;
    pen.textAlign = "left";
    for (const curve of curves.filter((one) => one.name)) {
      pen.strokeStyle = curve.colour;
      pen.lineWidth = curve.width;
      pen.setLineDash(curve.dash ? [7, 5] : []);
      pen.beginPath();
      pen.moveTo(x, 10);
      pen.lineTo(x + 28, 10);
      pen.stroke();
      pen.fillStyle = colours.ink;
      pen.fillText(curve.name, x + 34, 14);
      x += 50 + pen.measureText(curve.name).width;
    }
    pen.setLineDash([]);
  }
}

function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  const share = rough / power;
  return power * (share > 5 ? 10 : share > 2 ? 5 : share > 1 ? 2 : 1);
}
