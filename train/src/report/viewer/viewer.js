'use strict';
// Draws a scene of Gaussians with WebGL 2 as gsburn's rasterizer does. Data: see block.rs and scene.rs.
(async () => {
const root = document.getElementById('viewer'), place = root.dataset.place;
const text = id => document.getElementById(id).textContent.trim();
const WIDTH = 4096;                      // texels in a row of a data texture
const INSTANTS = 8;                      // of an exposure
const PASS = 4;                          // seconds in which the recording is played once

// ---- page -------------------------------------------------------------------------------------------------------
function make(tag, className, parent, content) {
  const element = document.createElement(tag);
  element.className = className;
  if (content !== undefined) element.textContent = content;
  parent.append(element);
  return element;
}
function button(parent, label, hint, action) {
  const element = make('button', '', parent, label);
  element.type = 'button'; element.title = hint; element.onclick = action;
  return element;
}
const stage = make('div', 'stage', root), canvas = make('canvas', '', stage), photo = make('img', 'photo', stage);
stage.tabIndex = 0; photo.alt = 'photo of this camera'; photo.hidden = true; photo.draggable = false;
const line = make('div', 'line', stage);
const time = make('div', 'bar time', root), bar = make('div', 'bar', root), list = make('div', 'cameras', root);
const status = make('p', 'status', root), live = place === 'live' ? make('div', 'live', root) : null;
function give_up(why) { root.className = 'viewer off'; root.textContent = why; }

// ---- data -------------------------------------------------------------------------------------------------------
async function unpack(base64, arrays) {
  const gzip = Uint8Array.from(atob(base64), c => c.charCodeAt(0));
  const stream = new Blob([gzip]).stream().pipeThrough(new DecompressionStream('gzip'));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer()), out = {};
  let at = 0;
  for (const {name, kind, step, length} of arrays) {
    const width = kind === 'f32' ? 4 : 2, words = new Uint8Array(width * length);
    for (let plane = 0; plane < width; plane++)
      for (let i = 0; i < length; i++) words[width * i + plane] = bytes[at++];
    if (kind === 'f32') { out[name] = new Float32Array(words.buffer); continue; }
    const n = new Uint16Array(words.buffer);
    out[name] = name === 'sh' ? Int16Array.from(n, v => (v >> 1) ^ -(v & 1))
      : Float32Array.from(n, v => ((v >> 1) ^ -(v & 1)) * step);
  }
  return out;
}

// ---- WebGL ------------------------------------------------------------------------------------------------------
const gl = canvas.getContext('webgl2', {antialias: false, alpha: false, preserveDrawingBuffer: true});
if (!gl || !window.DecompressionStream)
  return give_up('This browser has no WebGL 2, so the scene cannot be turned here. The pictures of the report show it.');
// Half floats keep what many faint Gaussians add up to; where a browser cannot draw to them, eight bits must do.
const halves = gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float');
function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text(id)); gl.compileShader(shader); gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw Error(id + ': ' + gl.getShaderInfoLog(shader));
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
  const names = new Map();
  return {made, at: name => names.get(name) ?? (names.set(name, gl.getUniformLocation(made, name)), names.get(name))};
}
const splat = program('splat-vertex', 'splat-fragment'), screen = program('screen-vertex', 'screen-fragment');
const [plainArray, splatArray] = [gl.createVertexArray(), gl.createVertexArray()], order = gl.createBuffer();
gl.bindVertexArray(splatArray); gl.bindBuffer(gl.ARRAY_BUFFER, order);
const input = gl.getAttribLocation(splat.made, 'gaussian');
gl.enableVertexAttribArray(input); gl.vertexAttribIPointer(input, 1, gl.UNSIGNED_INT, 0, 0);
gl.vertexAttribDivisor(input, 1);
function texture(unit, internal, format, type, width, height, data) {
  const made = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_2D, made);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, data);
  return made;
}
// A table of texels of four numbers.
function table(unit, internal, format, type, Kind, texels, fill) {
  const height = Math.max(1, Math.ceil(texels / WIDTH)), data = new Kind(4 * WIDTH * height);
  if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw Error('the scene is too large for this graphics card');
  fill(data);
  return texture(unit, internal, format, type, WIDTH, height, data);
}
const targets = [];
function target(index, w, h) {          // 0: an image; 1: the light of an exposure
  const old = targets[index];
  if (old && old.w === w && old.h === h) return old;
  if (old) { gl.deleteTexture(old.image); gl.deleteFramebuffer(old.frame); }
  const [internal, type] = halves ? [gl.RGBA16F, gl.HALF_FLOAT] : [gl.RGBA8, gl.UNSIGNED_BYTE];
  const image = texture(3, internal, gl.RGBA, type, w, h, null), frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, image, 0);
  return targets[index] = {w, h, image, frame};
}

// ---- scene ------------------------------------------------------------------------------------------------------
let scene = null, data = null, tables = [];
let t = 0, mode = 'colour', shown = 'off', wipe = 0.5, playing = false, large = false, view = null;
let camera = null, home = null, dirty = true;
async function load(described, block) {
  const found = await unpack(block, described.arrays), n = described.count, s = (described.degree + 1) ** 2;
  tables.forEach(made => gl.deleteTexture(made));
  const rowOf = new Float32Array(n);
  if (found.rows) found.rows.forEach((row, m) => { rowOf[row] = m + 1; });
  const {means, quats, log_scales: scales, logits, sh} = found;
  const of = (values, width, to, at, from) => { for (let i = 0; i < width; i++) to[at + i] = values[from + i]; };
  const [J, K, L] = described.blocks, all = J + K + L, turn = described.clock?.functions ? 3 : 4;
  tables = [
    table(0, gl.RGBA32F, gl.RGBA, gl.FLOAT, Float32Array, 3 * n, to => {
      for (let g = 0; g < n; g++) {
        of(means, 3, to, 12 * g, 3 * g); to[12 * g + 3] = logits[g];
        of(quats, 4, to, 12 * g + 4, 4 * g);
        of(scales, 3, to, 12 * g + 8, 3 * g); to[12 * g + 11] = rowOf[g];
      }
    }),
    table(1, gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT, Int16Array, s * n, to => {
      for (let c = 0; c < 3 * s; c++)
        for (let g = 0; g < n; g++) to[4 * (s * g + (c / 3 | 0)) + c % 3] = sh[c * n + g];
    }),
    table(2, gl.RGBA32F, gl.RGBA, gl.FLOAT, Float32Array, all * described.moving, to => {
      for (let m = 0; m < described.moving; m++) {
        for (let j = 0; j < J; j++) of(found.position, 3, to, 4 * (all * m + j), 3 * (J * m + j));
        for (let k = 0; k < K; k++) of(found.turn, turn, to, 4 * (all * m + J + k), turn * (K * m + k));
        for (let l = 0; l < L; l++) of(found.shape, 4, to, 4 * (all * m + J + K + l), 4 * (L * m + l));
      }
    }),
  ];
  [scene, data] = [described, {means, rows: found.rows, position: found.position}];
  sorter = null;
  t = Math.min(Math.max(t, scene.span?.[0] ?? t), scene.span?.[1] ?? t);
}

// ---- time: the weights of the blocks, as in gs_models::basis and motion.rs ------------------------------------
function inside(f, s) {                 // value and slope of a function of s
  if (f.ramp) {
    const side = Math.sign(f.ramp.far), near = Math.abs(f.ramp.near), far = Math.abs(f.ramp.far), x = s * side;
    const share = Math.min(Math.max((x - near) / (far - near), 0), 1);
    return [0.5 * share * share * (far - near) + Math.max(x - far, 0), side * share];
  }
  const {power: n, rate} = f.cosine ?? f.sine, [sin, cos] = [Math.sin(rate * s), Math.cos(rate * s)];
  const [phi, slope] = f.cosine ? [cos, -rate * sin] : [sin, rate * cos];
  return [s ** n * phi, n * s ** (n - 1) * phi + s ** n * slope];
}
function at(f, s) {
  if (Math.abs(s) <= 1 || !f.past) return inside(f, s);
  const [offset, slope] = f.past.line, fade = f.past.fade, edge = Math.sign(s), x = (Math.abs(s) - 1) / fade;
  const result = [offset + slope * s, slope];
  if (x >= 1) return result;
  const [value, steep] = inside(f, edge), excess = value - (offset + slope * edge), drift = (steep - slope) * edge * fade;
  result[0] += excess * (1 + x * x * (2 * x - 3)) + drift * x * (1 - x) * (1 - x);
  result[1] += (excess * 6 * x * (x - 1) + drift * (1 - x) * (1 - 3 * x)) * edge / fade;
  return result;
}
// Lists of [block, weight, slope by time], for positions and for rotations and shapes.
function weights(t) {
  const clock = scene.clock;
  if (!clock) return {position: [], turn: [], shape: []};
  if (clock.functions) {
    const {t0, half, position, turn} = clock.functions, s = (t - t0) / half;
    const list = functions => functions.map((f, j) => { const [v, d] = at(f, s); return [j, v, d / half]; });
    return {position: list(position), turn: list(turn), shape: []};
  }
  const {first, last, count, turns, shapes} = clock.keys, x = (t - first) / (last - first) * (count - 1);
  const i = Math.min(Math.max(Math.floor(x), 0), count - 2), u = x - i, rate = (count - 1) / (last - first);
  let w = [[0, -0.5, 1, -0.5], [1, 0, -2.5, 1.5], [0, 0.5, 2, -1.5], [0, 0, -0.5, 0.5]]   // Catmull and Rom's cubics
    .map(([a, b, c, d]) => [a + u * (b + u * (c + u * d)), (b + u * (2 * c + 3 * u * d)) * rate]);
  const add = (to, from, factor) => w[to].forEach((_, k) => { w[to][k] += factor * w[from][k]; });
  if (i === 0) { add(1, 0, 2); add(2, 0, -1); }
  if (i === count - 2) { add(2, 3, 2); add(1, 3, -1); }
  const list = w.map(([v, d], k) => [i - 1 + k, v, d]).filter(([key]) => key >= 0 && key < count);
  return {position: list, turn: turns ? list : [], shape: shapes ? list : []};
}

// ---- order: far to near, by all bits of the depth ----------------------------------------------------------------
let sorter = null;
function sort(now) {
  const n = scene.count, {means, rows, position} = data, {eye, right, down, forward} = camera;
  sorter ??= {moved: means.slice(), keys: new Uint32Array(n), ids: [new Uint32Array(n), new Uint32Array(n)]};
  const {moved, keys, ids: [a, b]} = sorter, J = scene.blocks[0];
  if (rows) for (let m = 0; m < rows.length; m++)
    for (let axis = 0; axis < 3; axis++) {
      let sum = means[3 * rows[m] + axis];
      for (const [j, weight] of now.position) sum += weight * position[3 * (J * m + j) + axis];
      moved[3 * rows[m] + axis] = sum;
    }
  const [fx, fy, fz] = forward, depth = new Float32Array(1), bits = new Uint32Array(depth.buffer);
  let count = 0;
  for (let g = 0; g < n; g++) {
    const z = fx * (moved[3 * g] - eye[0]) + fy * (moved[3 * g + 1] - eye[1]) + fz * (moved[3 * g + 2] - eye[2]);
    if (!(z >= scene.near && z <= scene.far)) continue;
    depth[0] = z; keys[g] = ~bits[0]; a[count++] = g;
  }
  for (const [shift, from, to] of [[0, a, b], [16, b, a]]) {
    const places = new Uint32Array(65537);
    for (let i = 0; i < count; i++) places[(keys[from[i]] >>> shift & 65535) + 1]++;
    for (let k = 0; k < 65536; k++) places[k + 1] += places[k];
    for (let i = 0; i < count; i++) to[places[keys[from[i]] >>> shift & 65535]++] = from[i];
  }
  // Equal depths: the rasterizer takes lower rows first, this order is drawn from the far end.
  for (let i = 0; i < count;) {
    let end = i + 1;
    while (end < count && keys[a[end]] === keys[a[i]]) end++;
    if (end > i + 1) a.subarray(i, end).reverse();
    i = end;
  }
  return a.subarray(0, count);
}

// ---- drawing ----------------------------------------------------------------------------------------------------
// Pixels of training in one of the page's.
const cssPixel = () => Math.max(camera.size[0] / canvas.clientWidth, camera.size[1] / canvas.clientHeight);
function size() {
  const scale = large ? Math.max(1, devicePixelRatio / cssPixel()) : 1;
  return [Math.round(camera.size[0] * scale), Math.round(camera.size[1] * scale)];
}
function splats(t, [w, h]) {
  const now = weights(t), drawn = sort(now), {eye, right, down, forward, k} = camera, s = w / camera.size[0];
  gl.bindFramebuffer(gl.FRAMEBUFFER, target(0, w, h).frame);
  gl.viewport(0, 0, w, h); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT);
  gl.useProgram(splat.made); gl.bindVertexArray(splatArray);
  gl.bindBuffer(gl.ARRAY_BUFFER, order); gl.bufferData(gl.ARRAY_BUFFER, drawn, gl.DYNAMIC_DRAW);
  tables.forEach((made, unit) => { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_2D, made); });
  ['rows', 'sh', 'motion'].forEach((name, unit) => gl.uniform1i(splat.at(name), unit));
  const used = new Int32Array(128), values = new Float32Array(192);
  now.position.forEach(([block, weight, slope], i) => { used[2 * i] = block; values.set([weight, slope], 3 * i); });
  [...(now.turn.length ? now.turn : now.shape)].forEach(([block, weight], i) => { used[2 * i + 1] = block; values[3 * i + 2] = weight; });
  gl.uniform2iv(splat.at('used'), used); gl.uniform3fv(splat.at('weights'), values);
  gl.uniform3i(splat.at('blocks'), ...scene.blocks);
  gl.uniform3i(splat.at('counts'), now.position.length, now.turn.length, now.shape.length);
  gl.uniform1i(splat.at('turnsAreVectors'), scene.clock?.functions ? 1 : 0);
  gl.uniform1i(splat.at('degree'), scene.degree);
  gl.uniform1f(splat.at('shStep'), scene.arrays.find(array => array.name === 'sh').step);
  gl.uniformMatrix3fv(splat.at('rotation'), false, [0, 1, 2].flatMap(i => [right[i], down[i], forward[i]]));
  gl.uniform3f(splat.at('eye'), ...eye);
  gl.uniform4f(splat.at('pinhole'), ...k.map(pixels => pixels * s));
  gl.uniform2f(splat.at('size'), w, h); gl.uniform2f(splat.at('range'), scene.near, scene.far);
  gl.uniform1f(splat.at('eps2d'), scene.eps2d); gl.uniform1i(splat.at('antialiased'), scene.antialiased ? 1 : 0);
  gl.uniform1f(splat.at('fullSpeed'), mode === 'velocity' ? scene.full_speed : 0);
  gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, drawn.length);
}
function finish(task, image, share, to, [w, h]) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, to); gl.viewport(0, 0, w, h);
  gl.useProgram(screen.made); gl.bindVertexArray(plainArray);
  gl.activeTexture(gl.TEXTURE3); gl.bindTexture(gl.TEXTURE_2D, image);
  gl.uniform1i(screen.at('picture'), 3); gl.uniform1i(screen.at('task'), task); gl.uniform1f(screen.at('share'), share);
  gl.uniform1i(screen.at('linear'), scene.shutter?.linear && mode === 'exposure' ? 1 : 0);
  gl.uniform3f(screen.at('background'), ...(mode === 'velocity' ? [0.5, 0.5, 0.5] : scene.background));
  gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, task === 1 ? gl.ONE : gl.ZERO);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}
function draw() {
  const [w, h] = size();
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  if (mode !== 'exposure') {
    splats(t, [w, h]); finish(0, target(0, w, h).image, 1, null, [w, h]);
  } else {
    const light = target(1, w, h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, light.frame); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT);
    for (let i = 0; i < INSTANTS; i++) {
      splats(t + ((i + 0.5) / INSTANTS - 0.5) * scene.shutter.exposure, [w, h]);
      finish(1, target(0, w, h).image, 1 / INSTANTS, light.frame, [w, h]);
    }
    finish(2, light.image, 1, null, [w, h]);
  }
  tell();
}

// ---- camera -----------------------------------------------------------------------------------------------------
const plus = (a, b, s = 1) => a.map((x, i) => x + s * b[i]), dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => a.map(x => x / Math.hypot(...a));
const turned = (v, axis, angle) => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)], along = dot(v, axis) * (1 - c), side = cross(axis, v);
  return v.map((x, i) => x * c + side[i] * s + axis[i] * along);
};
function look(from) {
  const m = from.c2w, column = i => [m[i], m[4 + i], m[8 + i]];
  const [right, down, forward, eye] = [0, 1, 2, 3].map(column);
  return {eye, right, down, forward, k: from.k, size: from.size, target: plus(eye, forward, scene.distance)};
}
function up() {                         // of the world: what most cameras hold up
  const sum = scene.cameras.reduce((sum, from) => [0, 1, 2].map(i => sum[i] - from.c2w[4 * i + 1]), [0, 0, 0]);
  return Math.hypot(...sum) > 1e-6 ? unit(sum) : camera.down.map(x => -x);
}
function turn(yaw, pitch, about) {      // about: a point, or the eye
  for (const [axis, angle] of [[up(), yaw], [camera.right, pitch]]) {
    camera.eye = plus(about, turned(plus(camera.eye, about, -1), axis, angle));
    camera.target = plus(about, turned(plus(camera.target, about, -1), axis, angle));
    for (const name of ['right', 'down', 'forward']) camera[name] = unit(turned(camera[name], axis, angle));
  }
  moved();
}
function shift(x, y, z) {
  const by = plus(plus(camera.right.map(a => a * x), camera.down, y), camera.forward, z);
  camera.eye = plus(camera.eye, by); camera.target = plus(camera.target, by);
  moved();
}
function dolly(factor) {
  const away = plus(camera.eye, camera.target, -1);
  camera.eye = plus(camera.target, away, factor);
  moved();
}
const reach = () => Math.hypot(...plus(camera.target, camera.eye, -1));
function moved() { view = null; dirty = true; marks(); }
function choose(index) {
  view = index; camera = look(scene.cameras[index]);
  const own = scene.cameras[index].time;
  if (scene.span && own !== null) t = Math.min(Math.max(own, scene.span[0]), scene.span[1]);
  dirty = true; marks();
}

// ---- controls ---------------------------------------------------------------------------------------------------
const fingers = new Map();
stage.onpointerdown = event => {
  stage.focus({preventScroll: true});
  if (shown === 'wipe' && !photo.hidden && Math.abs(event.offsetX - wipe * canvas.clientWidth) < 14) fingers.wiping = event.pointerId;
  fingers.set(event.pointerId, event); stage.setPointerCapture(event.pointerId);
};
stage.onpointermove = event => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  if (fingers.wiping === event.pointerId) {
    const box = canvas.getBoundingClientRect();
    wipe = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return marks();
  }
  const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY], pixel = reach() / camera.k[0] * cssPixel();
  const other = [...fingers.values()].find(finger => finger.pointerId !== event.pointerId);
  if (other) {
    const gap = from => Math.hypot(from.clientX - other.clientX, from.clientY - other.clientY);
    dolly(gap(before) / Math.max(gap(event), 1)); shift(-0.5 * x * pixel, -0.5 * y * pixel, 0);
  } else if (before.button > 0 || event.shiftKey) shift(-x * pixel, -y * pixel, 0);
  else if (event.altKey) turn(x * 0.003, -y * 0.003, camera.eye);
  else turn(-x * 0.006, -y * 0.006, camera.target);
  fingers.set(event.pointerId, Object.assign(event, {}));
};
stage.onpointerup = stage.onpointercancel = event => { fingers.delete(event.pointerId); fingers.wiping = null; };
stage.oncontextmenu = event => event.preventDefault();
stage.addEventListener('wheel', event => {   // a report must scroll until its viewer was clicked
  if (place === 'report' && document.activeElement !== stage) return;
  event.preventDefault(); dolly(Math.exp(event.deltaY * 0.001));
}, {passive: false});
const held = new Set(), FLY = {w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, 1, 0], e: [0, -1, 0]};
stage.onkeydown = event => {
  const key = event.key.toLowerCase(), step = scene.span ? (scene.span[1] - scene.span[0]) / 48 : 0;
  if (event.ctrlKey || event.metaKey) return;
  if (FLY[key]) held.add(key);
  else if (key === 'h' || key === 'home') choose(home);
  else if (key === ' ') playing = scene.span && !playing;
  else if (key === 'arrowleft' || key === 'arrowright') seek(t + (key === 'arrowleft' ? -step : step));
  else if (key === 'v' && scene.clock) mode = mode === 'velocity' ? 'colour' : 'velocity';
  else if (key === 'b' && scene.shutter) mode = mode === 'exposure' ? 'colour' : 'exposure';
  else if (key === 'p') shown = {off: 'wipe', wipe: 'beside', beside: 'off'}[shown];
  else if (key === 'f') large = !large;
  else if (key >= '1' && key <= '9' && scene.cameras[key - 1]) choose(key - 1);
  else return;
  event.preventDefault(); dirty = true; marks();
};
stage.onkeyup = event => held.delete(event.key.toLowerCase());
stage.onblur = () => held.clear();
function seek(to) { t = Math.min(Math.max(to, scene.span[0]), scene.span[1]); dirty = true; marks(); }

// ---- buttons ----------------------------------------------------------------------------------------------------
const controls = {};
function build() {
  [time, bar, list].forEach(part => part.replaceChildren());
  time.hidden = !scene.span;
  controls.play = button(time, '', 'Play or pause (space)', () => { playing = !playing; marks(); });
  controls.slider = make('input', '', time);
  Object.assign(controls.slider, {type: 'range', min: 0, max: 1, step: 'any', title: 'Time (arrow keys)'});
  controls.slider.oninput = () => { playing = false; seek(scene.span[0] + controls.slider.value * (scene.span[1] - scene.span[0])); };
  controls.time = make('output', '', time);
  const group = (label, choices, get, set) => {
    const box = make('span', 'group', bar);
    make('span', 'label', box, label);
    return choices.map(([value, name, hint]) => {
      const made = button(box, name, hint, () => { set(value); dirty = true; marks(); });
      return () => made.setAttribute('aria-pressed', get() === value);
    });
  };
  button(bar, 'Home', 'Back to the first camera (H)', () => choose(home));
  const modes = [['colour', 'Colour', 'The scene, sharp']];
  if (scene.shutter) modes.push(['exposure', 'Exposure', 'As the exposure saw it: the mean over its time (B)']);
  if (scene.clock) modes.push(['velocity', 'Velocity', 'Grey: at rest; red, green and blue: the world\'s axes (V)']);
  controls.marks = modes.length > 1 ? group('Show', modes, () => mode, value => { mode = value; }) : [];
  if (scene.cameras.some(from => from.photo))
    controls.marks.push(...group('Photo', [['off', 'Off', 'No photo (P)'], ['wipe', 'Wipe', 'Photo over the left of the rendering; drag the line (P)'],
      ['beside', 'Beside', 'Photo beside the rendering (P)']], () => shown, value => { shown = value; if (view === null) choose(home); }));
  controls.marks.push(...group('Pixels', [[false, scene.cameras[home].size.join(' × '), 'Those of training: finer ones show needles that no photo saw (F)'],
    [true, 'Screen', 'As many as the screen has (F)']], () => large, value => { large = value; }));
  const help = make('details', 'help', bar);
  make('summary', '', help, 'Keys');
  make('p', '', help, 'Drag: orbit. Shift or right button: pan. Alt: look around. Wheel or pinch: nearer. W A S D Q E: fly. H: home. 1–9: cameras. '
    + 'Space, arrows: time. V: velocity. B: exposure. P: photo. F: pixels.');
  controls.cameras = scene.cameras.map((from, index) => {
    const previous = scene.cameras[index - 1];
    if (from.split && from.split !== previous?.split) make('span', 'label', list, from.split);
    const made = button(list, '', from.name + (from.time === null ? '' : ', time ' + from.time), () => choose(index));
    if (from.photo) { const small = make('img', '', made); small.src = from.photo; small.alt = from.name; } else made.textContent = from.name;
    return made;
  });
  list.hidden = scene.cameras.length < 2;
}
function marks() {
  if (!scene) return;
  controls.marks.forEach(mark => mark());
  controls.cameras.forEach((made, index) => made.setAttribute('aria-pressed', index === view));
  const own = view === null || shown === 'off' ? null : scene.cameras[view].photo;
  photo.hidden = !own; stage.dataset.photo = own ? shown : 'off';
  if (own && photo.src !== own) photo.src = own;
  photo.style.clipPath = shown === 'wipe' ? `inset(0 ${100 - 100 * wipe}% 0 0)` : '';
  line.style.left = 100 * wipe + '%'; line.hidden = !own || shown !== 'wipe';
  controls.play.textContent = playing ? '❚❚' : '▶';
  if (!scene.span) return;
  controls.slider.value = (t - scene.span[0]) / (scene.span[1] - scene.span[0]);
  // Of a clock's seconds only those since the begin tell anything.
  controls.time.textContent = Math.abs(scene.span[0]) > 1e4 ? '+' + (t - scene.span[0]).toFixed(3) : 't = ' + t.toFixed(3);
  if (t > scene.seen_to) controls.time.textContent += ' (predicted)';
}
function tell() {
  const number = n => n.toLocaleString('en').replaceAll(',', '\u202f'), parts = [number(scene.count) + ' Gaussians', 'SH ' + scene.degree];
  if (scene.moving) parts.push(number(scene.moving) + ' move');
  parts.push(`${canvas.width} × ${canvas.height} pixels`, ...scene.notes);
  if (!halves) parts.push('eight bits a channel: this browser has no half floats');
  if (view !== null && scene.cameras[view].split) parts.unshift(scene.cameras[view].name);
  status.textContent = parts.join(' · ');
}

// ---- begin ------------------------------------------------------------------------------------------------------
function begin() {
  home = 0; t = scene.middle;
  camera = look(scene.cameras[0]); build(); choose(0); requestAnimationFrame(frame);
}
let before = 0;
function frame(now) {
  const passed = Math.min((now - before) / 1000, 0.1);
  before = now;
  for (const key of held) shift(...FLY[key].map(x => x * 0.7 * reach() * passed));
  if (playing && scene.span) {
    const [first, last] = scene.span, next = t + passed * (last - first) / PASS;
    seek(next > last ? first : next);
  }
  if (dirty) { dirty = false; draw(); }
  requestAnimationFrame(frame);
}
new ResizeObserver(() => { dirty = true; }).observe(stage);
// #picture=CAMERA@TIME@MODE,...: the pictures as data URLs in the page, for tests and scripts.
function pictures(asked) {
  for (const one of asked.split(',')) {
    const [index, when, how] = one.split('@');
    choose(+index); t = +when; mode = how ?? 'colour'; draw();
    make('pre', 'picture', document.body, canvas.toDataURL('image/png'));
  }
}
try {
  if (live) return follow({load, make, live, started: () => scene, begin, changed: () => { build(); dirty = true; marks(); }});
  await load(JSON.parse(text('viewer-scene')), text('viewer-block'));
  begin();
  if (location.hash.startsWith('#picture=')) pictures(location.hash.slice(9));
} catch (error) { give_up('The scene cannot be shown here: ' + error.message); throw error; }
})();
