"use strict";
// Figures: drag to zoom into a part, + and − or the keyboard, double click or Reset for all of it; the pointer reads values.
for (const frame of document.querySelectorAll(".frame")) {
  const svg = frame.querySelector("svg"), tools = document.createElement("div"), read = document.createElement("output");
  const whole = svg.getAttribute("viewBox").split(" ").map(Number);
  const axes = JSON.parse(svg.dataset.axes || "[]");
  let view = whole, from = null;
  const show = (next) => {
    svg.setAttribute("viewBox", (view = next).join(" "));
    svg.classList.toggle("near", view[2] < whole[2]);
  };
  const zoom = (factor) => {
    const [x, y, w, h] = view, width = Math.min(w * factor, whole[2]), height = Math.min(h * factor, whole[3]);
    const inside = (low, size, room) => Math.max(0, Math.min(low, room - size));
    show([inside(x + (w - width) / 2, width, whole[2]), inside(y + (h - height) / 2, height, whole[3]), width, height]);
  };
  const place = (event) => {
    const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [p.x, p.y];
  };
  const values = ([x, y]) => {
    const axis = axes.find((a) => x >= a.box[0] && x <= a.box[2] && y >= a.box[1] && y <= a.box[3]);
    if (!axis) return "";
    const along = (side, share) => {
      const at = side.low + share * (side.high - side.low);
      if (side.scale === "log") return 10 ** at;
      if (side.scale !== "symlog") return at;
      const size = Math.abs(at) / side.linear;
      return Math.sign(at) * side.linear * (size <= side.bend ? size / side.bend : 10 ** (size - side.bend));
    };
    const across = along(axis.x, (x - axis.box[0]) / (axis.box[2] - axis.box[0]));
    const up = along(axis.y, (axis.box[3] - y) / (axis.box[3] - axis.box[1]));
    return `${axis.x.label}: ${across.toPrecision(4)}   ${axis.y.label}: ${up.toPrecision(3)}`;
  };
  for (const [text, name, act] of [["+", "zoom in", () => zoom(0.6)], ["−", "zoom out", () => zoom(1 / 0.6)],
    ["Reset", "show all", () => show(whole)]]) {
    const button = document.createElement("button");
    button.textContent = text;
    button.setAttribute("aria-label", name);
    button.onclick = act;
    tools.append(button);
  }
  tools.className = "tools";
  tools.append(read);
  frame.before(tools);
  svg.onpointerdown = (event) => { if (event.pointerType === "mouse") { from = place(event); event.preventDefault(); } };
  svg.onpointermove = (event) => { read.value = values(place(event)); };
  svg.onpointerup = (event) => {
    if (!from) return;
    const to = place(event), low = [0, 1].map((i) => Math.min(from[i], to[i]));
    const size = [0, 1].map((i) => Math.abs(to[i] - from[i]));
    from = null;
    if (size[0] > 8 && size[1] > 8) show([...low, ...size]);
  };
  svg.ondblclick = () => show(whole);
}
// Folded parts: a link opens the part that it leads to; all of them are printed.
const unfold = (part) => { for (let d = part && part.closest("details"); d; d = d.parentElement.closest("details")) d.open = true; };
const follow = () => { const part = location.hash && document.getElementById(location.hash.slice(1)); unfold(part); if (part) part.scrollIntoView(); };
addEventListener("hashchange", follow);
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
follow();
// Text to copy.
for (const text of document.querySelectorAll("pre.copied")) {
  const button = document.createElement("button");
  button.textContent = "Copy";
  button.onclick = async () => {
    try { await navigator.clipboard.writeText(text.textContent); } catch { getSelection().selectAllChildren(text); document.execCommand("copy"); }
    button.textContent = "Copied";
  };
  text.before(button);
}
