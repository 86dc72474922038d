"use strict";
(() => {
  const data = JSON.parse(document.getElementById("flight").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const position = new Float32Array(bytes(data.position).buffer);
  const target = new Float32Array(bytes(data.target).buffer);
  const verdicts = bytes(data.verdicts);
  const agents = data.leaders.length, links = data.heard.length, moments = data.seconds.length;
  const canvas = document.querySelector(".scene canvas"), pen = canvas.getContext("2d");
  const slider = document.querySelector(".scene input"), told = document.querySelector(".scene output");
  const button = document.querySelector(".scene button");
  const at = (of, moment, agent) => [of[2 * (moment * agents + agent)], of[2 * (moment * agents + agent) + 1]];

  function draw() {
    const moment = Number(slider.value), ratio = window.devicePixelRatio || 1;
    const wide = canvas.clientWidth, high = canvas.clientHeight;
    canvas.width = wide * ratio; canvas.height = high * ratio;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const ink = getComputedStyle(document.body).color;
    let low = [Infinity, Infinity], top = [-Infinity, -Infinity];
    for (let agent = 0; agent < agents; agent++) {
      const [x, y] = at(target, moment, agent);
      if (Number.isNaN(x + y)) continue;
      low = [Math.min(low[0], x), Math.min(low[1], y)]; top = [Math.max(top[0], x), Math.max(top[1], y)];
    }
    const scale = Math.min(wide / (1.5 * data.extent[0] + 1e-9), high / (1.5 * data.extent[1] + 1e-9));
    const place = ([x, y]) => [
      wide / 2 + scale * (x - (low[0] + top[0]) / 2), high / 2 - scale * (y - (low[1] + top[1]) / 2)];
    const line = (points, colour, width, alpha = 1) => {
      pen.globalAlpha = alpha; pen.strokeStyle = colour; pen.lineWidth = width; pen.beginPath();
      points.forEach((point, number) => pen[number ? "lineTo" : "moveTo"](...place(point)));
      pen.stroke(); pen.globalAlpha = 1;
    };
    for (const wall of data.walls) line(wall, "#a08f78", 2);
    for (const [x, y, radius] of data.zones) {
      pen.globalAlpha = 0.25; pen.fillStyle = "#f2d024"; pen.beginPath();
      pen.arc(...place([x, y]), radius * scale, 0, 7); pen.fill(); pen.globalAlpha = 1;
    }
    for (const [one, other] of data.edges) line([at(target, moment, one), at(target, moment, other)], ink, 0.7, 0.35);
    for (let agent = 0; agent < agents; agent++) {
      const way = [];
      for (let before = Math.max(0, moment - data.trail); before <= moment; before++) way.push(at(position, before, agent));
      line(way, data.leaders[agent] ? data.gold : data.blue, 1, 0.6);
    }
    for (let link = 0; link < links; link++) {
      const [src, dst] = data.heard[link], said = data.colours[verdicts[moment * links + link]];
      if (!said) continue;
      const [x0, y0] = at(position, moment, src), [x1, y1] = at(position, moment, dst);
      line([[(x0 + x1) / 2, (y0 + y1) / 2], [x1, y1]], said, 2);
    }
    pen.font = "12px system-ui, sans-serif"; pen.textAlign = "center";
    for (let agent = 0; agent < agents; agent++) {
      const [x, y] = place(at(position, moment, agent));
      pen.fillStyle = data.leaders[agent] ? data.gold : data.blue; pen.beginPath(); pen.arc(x, y, 5, 0, 7); pen.fill();
      pen.fillStyle = ink; pen.fillText(agent + 1, x, y - 8);
    }
    const least = 60 / scale, ten = 10 ** Math.floor(Math.log10(least));
    const long = ten * [1, 2, 5, 10].find((factor) => factor * ten >= least), end = 12 + long * scale;
    pen.strokeStyle = pen.fillStyle = ink; pen.lineWidth = 1; pen.textAlign = "left"; pen.beginPath();
    pen.moveTo(12, high - 14); pen.lineTo(12, high - 10); pen.lineTo(end, high - 10); pen.lineTo(end, high - 14); pen.stroke();
    pen.fillText(`${Number(long.toPrecision(1))} m`, 16, high - 14);
    told.value = `${data.seconds[moment].toFixed(2)} s`;
    const share = moments > 1 ? data.seconds[moment] / data.seconds[moments - 1] : 0;
    for (const cursor of document.querySelectorAll("svg .cursor")) {
      const [left, right] = cursor.dataset.span.split(" ").map(Number);
      for (const end of ["x1", "x2"]) cursor.setAttribute(end, left + share * (right - left));
    }
  }

  let playing = null;
  const step = (now) => {
    if (playing === null) return;
    const elapsed = (now - playing.began) / 1000 * data.speed + playing.from;
    let moment = data.seconds.findIndex((seconds) => seconds >= elapsed);
    if (moment < 0) { moment = moments - 1; stop(); }
    slider.value = moment; draw();
    if (playing !== null) requestAnimationFrame(step);
  };
  const stop = () => { playing = null; button.textContent = "play"; };
  button.addEventListener("click", () => {
    if (playing !== null) { stop(); return; }
    if (Number(slider.value) === moments - 1) slider.value = 0;
    playing = { began: performance.now(), from: data.seconds[Number(slider.value)] };
    button.textContent = "stop"; requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => { stop(); draw(); });
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
