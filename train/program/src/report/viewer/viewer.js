'use strict';
// Draws a scene of Gaussians with WebGL 2 as gsburn's rasterizer does. Data: see scene.rs, block.rs and motion.rs.
(async () => {
const text = id => document.getElementById(id).textContent.trim();
const root = document.getElementById('viewer'), part = selector => root.querySelector(selector), place = root.dataset.place;
const WIDTH = 4096;                      // texels in a row of a data texture
const INSTANTS = 8;                      // of an exposure
const PASS = 4;                          // seconds in which the recording is played once
const MAGNIFICATION = +root.dataset.magnification; // most pixels of the page for one of training
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const isolated = name => '\u2068' + name + '\u2069'; // its direction of writing ends with it
const make = (tag, parent, properties) => parent.appendChild(Object.assign(document.createElement(tag), properties));
function give_up(why) {
  root.textContent = why;
  if (place !== 'page') return;          // a report has its own pictures below
  for (const {photo, name} of given.cameras) if (photo) make('img', root, {src: photo, alt: name, title: name});
}
const given = place === 'live' ? null : JSON.parse(text('viewer-scene'));

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
    out[name] = kind === 'f32' ? new Float32Array(words.buffer)
      : Float32Array.from(new Uint16Array(words.buffer), v => step * ((v >> 1) ^ -(v & 1)));
  }
  return out;
}

// ---- WebGL ------------------------------------------------------------------------------------------------------
const canvas = part('canvas'), gl = canvas.getContext('webgl2', {antialias: false, alpha: false, preserveDrawingBuffer: true});
if (!gl || !window.DecompressionStream)
  return give_up('This browser has no WebGL 2, so the scene cannot be turned here; only pictures of it can be seen.');
// Half floats keep what many faint Gaussians add up to. Where a browser cannot draw to them, ten bits must do, which every WebGL 2 has.
const halves = gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float');
function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text(id));
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
  return made;
}
function uniforms(of, values) {          // by WebGL's name of the type and the shader's name
  gl.useProgram(of);
  for (const [type, name, ...value] of values) gl['uniform' + type](gl.getUniformLocation(of, name), ...value);
}
const splat = program('splat-vertex', 'splat-fragment'), screen = program('screen-vertex', 'screen-fragment');
const gaussian = gl.getAttribLocation(splat, 'gaussian');
gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
gl.enableVertexAttribArray(gaussian);
gl.vertexAttribIPointer(gaussian, 1, gl.UNSIGNED_INT, 0, 0);
gl.vertexAttribDivisor(gaussian, 1);
gl.enable(gl.BLEND);
// One texture a unit, filled again and again: 0 to 2 the scene, 3 an image, 4 the mean of an exposure.
const textures = [0, 1, 2, 3, 4].map(unit => {
  const made = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, made);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  return made;
});
function fill(unit, internal, type, width, height, data) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, gl.RGBA, type, data);
}
// Texels of four numbers. Each part has its first `width` numbers at `offset`, the next ones `stride` numbers further on.
function table(unit, internal, texels, parts) {
  const height = Math.max(1, Math.ceil(texels / WIDTH)), data = new Float32Array(4 * WIDTH * height);
  if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE)) throw Error('the scene is too large for this graphics card');
  for (const [values, width, stride, offset] of parts)
    for (let i = 0; i < values.length; i++) data[stride * Math.floor(i / width) + offset + i % width] = values[i];
  fill(unit, internal, gl.FLOAT, WIDTH, height, data);
}
const targets = {3: gl.createFramebuffer(), 4: gl.createFramebuffer()};
function resize(w, h) {
  if (canvas.width === w && canvas.height === h) return;
  [canvas.width, canvas.height] = [w, h];
  for (const [unit, frame] of Object.entries(targets)) {
    fill(+unit, ...(halves ? [gl.RGBA16F, gl.HALF_FLOAT] : [gl.RGB10_A2, gl.UNSIGNED_INT_2_10_10_10_REV]), w, h, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, textures[unit], 0);
  }
}

// ---- scene ------------------------------------------------------------------------------------------------------
let scene = null, data = null, dirty = true, begun = false, shown_views = null;
const now = {t: 0, view: null, mode: 'colour', photo: 'off', pixels: 'training', wipe: 0.5, playing: false};
async function load(described, block) {
  const found = await unpack(block, described.arrays), n = described.count, s = (described.degree + 1) ** 2;
  const {means, quats, log_scales, logits, sh, weights, rows = [], position = [], turn = [], shape = []} = found;
  const texels = shape.length ? 3 : turn.length ? 2 : 1, motionRow = new Float32Array(n);
  rows.forEach((row, m) => { motionRow[row] = m + 1; });
  const plane = (_, c) => [sh.subarray(c * n, c * n + n), 1, 4 * s, 4 * Math.floor(c / 3) + c % 3];
  table(0, gl.RGBA32F, 3 * n, [[means, 3, 12, 0], [logits, 1, 12, 3], [quats, 4, 12, 4], [log_scales, 3, 12, 8], [motionRow, 1, 12, 11]]);
  table(1, gl.RGBA16F, s * n, Array.from({length: 3 * s}, plane));
  table(2, gl.RGBA32F, texels * position.length / 3, [position, turn, shape].map((values, i) => [values, i ? 4 : 3, 4 * texels, 4 * i]));
  data = {means, rows, position, texels, weights, moved: means.slice(), keys: new Uint32Array(n), ids: [0, 1].map(() => new Uint32Array(n))};
  const views = described.cameras.map(({name, photo}) => name + photo).join();
  const same = scene && views === shown_views;
  [scene, shown_views] = [described, views];
  build();
  if (same) return seek(now.t);
  now.t = scene.middle;
  choose(0);
  if (!begun) requestAnimationFrame(frame);
  begun = true;
}
// The blocks that count at a time, each with its weight and the slope of that: Hermite's cubics between the knots of motion.rs.
function weights(t) {
  if (!scene.clock) return [];
  const {first, last, knots, blocks} = scene.clock, step = (last - first) / (knots - 1), found = [];
  const i = clamp(Math.floor((t - first) / step), 0, knots - 2), u = (t - first) / step - i;
  for (let block = 0; block < blocks; block++) {
    const [[a, c], [b, d]] = [i, i + 1].map(knot => data.weights.subarray(2 * (blocks * knot + block)));
    const p = 3 * (b - a) - 2 * c - d, q = 2 * (a - b) + c + d;
    const weight = a + u * (c + u * (p + u * q)), slope = (c + u * (2 * p + 3 * u * q)) / step;
    if (weight || slope) found.push([block, weight, slope]);
  }
  return found;
}
// The Gaussians far to near, by all bits of the depth; of equal depths the rasterizer blends lower rows first.
function sort(counting) {
  const {means, rows, position, moved, keys, ids: [a, b]} = data, {c2w} = camera;
  for (let m = 0; m < rows.length; m++)
    for (let axis = 0; axis < 3; axis++) {
      let sum = means[3 * rows[m] + axis];
      for (const [block, weight] of counting) sum += weight * position[3 * (scene.clock.blocks * m + block) + axis];
      moved[3 * rows[m] + axis] = sum;
    }
  const [x, y, z, , eyeX, eyeY, eyeZ] = c2w.toFloat64Array().slice(8), depth = new Float32Array(1), bits = new Uint32Array(depth.buffer);
  let count = 0;
  for (let g = scene.count - 1; g >= 0; g--) {
    depth[0] = x * (moved[3 * g] - eyeX) + y * (moved[3 * g + 1] - eyeY) + z * (moved[3 * g + 2] - eyeZ);
    if (!(depth[0] >= scene.near && depth[0] <= scene.far)) continue;
    keys[g] = ~bits[0];
    a[count++] = g;
  }
  for (const [shift, from, to] of [[0, a, b], [16, b, a]]) {
    const places = new Uint32Array(65537);
    for (let i = 0; i < count; i++) places[(keys[from[i]] >>> shift & 65535) + 1]++;
    for (let k = 0; k < 65536; k++) places[k + 1] += places[k];
    for (let i = 0; i < count; i++) to[places[keys[from[i]] >>> shift & 65535]++] = from[i];
  }
  return a.subarray(0, count);
}

// ---- drawing ----------------------------------------------------------------------------------------------------
// Pixels of training in one of the page's.
const cssPixel = () => Math.max(camera.size[0] / canvas.clientWidth, camera.size[1] / canvas.clientHeight);
function splats(t) {
  const counting = weights(t), drawn = sort(counting), [w, h] = [canvas.width, canvas.height], columns = camera.c2w.toFloat32Array();
  gl.bindFramebuffer(gl.FRAMEBUFFER, targets[3]);
  gl.viewport(0, 0, w, h);
  gl.clearColor(...(now.mode === 'velocity' ? [0.5, 0.5, 0.5] : scene.background), 1);
  gl.clear(gl.COLOR_BUFFER_BIT);
  gl.bufferData(gl.ARRAY_BUFFER, drawn, gl.DYNAMIC_DRAW);
  uniforms(splat, [
    ['1i', 'rows', 0], ['1i', 'sh', 1], ['1i', 'motion', 2], ['1i', 'degree', scene.degree],
    ['1i', 'texels', data.texels], ['1i', 'blocks', scene.clock?.blocks ?? 0], ['1i', 'vectors', scene.clock?.vectors ? 1 : 0],
    ['1i', 'count', counting.length], ['3fv', 'weights', [...counting.flat(), 0, 0, 0]],
    ['Matrix3fv', 'axes', false, [0, 4, 8].flatMap(i => [...columns.slice(i, i + 3)])], ['3f', 'eye', ...columns.slice(12, 15)],
    ['4f', 'pinhole', ...camera.k.map(pixels => pixels * w / camera.size[0])], ['2f', 'size', w, h], ['2f', 'range', scene.near, scene.far],
    ['1f', 'eps2d', scene.eps2d], ['1i', 'antialiased', scene.antialiased ? 1 : 0],
    ['1f', 'fullSpeed', now.mode === 'velocity' ? scene.full_speed : 0],
  ]);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, drawn.length);
}
// Mixes a share of a texture's image into a target (null: the canvas); tasks are those of screen.frag.
function mix(unit, frame, share, task) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  uniforms(screen, [['1i', 'picture', unit], ['1i', 'task', task]]);
  gl.blendColor(0, 0, 0, share);
  gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}
function draw() {
  const scale = now.pixels === 'screen' ? Math.max(1, devicePixelRatio / cssPixel()) : 1;
  resize(...camera.size.map(pixels => Math.round(pixels * scale)));
  const {exposure, linear} = now.mode === 'exposure' ? scene.shutter : {exposure: 0, linear: false}, instants = exposure ? INSTANTS : 1;
  for (let i = 0; i < instants; i++) {
    splats(now.t + ((i + 0.5) / instants - 0.5) * exposure);
    mix(3, targets[4], 1 / (i + 1), linear ? 1 : 0);
  }
  mix(4, null, 1, linear ? 2 : 0);
}

// ---- camera -----------------------------------------------------------------------------------------------------
let camera = null;                       // c2w: right, down, forward, eye; distance of the point that it turns about
function choose(view) {
  const {c2w, k, size, time} = scene.cameras[view];
  camera = {c2w: new DOMMatrix(c2w), distance: scene.distance, k, size};
  now.view = view;
  seek(time ?? now.t);
}
function place_at(c2w, distance = camera.distance) {
  camera = {...camera, c2w, distance};
  now.view = null;
  dirty = true;
}
function turn(yaw, pitch, ahead) {       // degrees, about the point so far ahead
  const [x, y, z] = scene.up, up = camera.c2w.inverse().transformPoint({x, y, z, w: 0});
  const about = camera.c2w.translate(0, 0, ahead).rotateAxisAngle(up.x, up.y, up.z, yaw).rotateAxisAngle(1, 0, 0, pitch);
  place_at(about.translate(0, 0, -ahead));
}
const shift = (right, down, forward) => place_at(camera.c2w.translate(right, down, forward));
const dolly = factor => place_at(camera.c2w.translate(0, 0, camera.distance * (1 - factor)), camera.distance * factor);
function seek(t) {
  now.t = scene.span ? clamp(t, ...scene.span) : t;
  dirty = true;
}
const keyframes = [];                    // for `gsburn render --cameras`, in the data set's own world
function keep() {
  const world = new DOMMatrix(scene.world).multiply(camera.c2w), [width, height] = camera.size;
  const column = (matrix, i) => [...matrix.toFloat64Array().slice(4 * i, 4 * i + 3)];
  keyframes.push({position: column(world, 3), look_at: column(world.translate(0, 0, camera.distance), 3), up: column(world, 1).map(x => -x),
    fov: 360 / Math.PI * Math.atan(height / 2 / camera.k[1]), time: scene.span ? now.t : undefined});
  const json = JSON.stringify({keyframes, width, height});
  Object.assign(part('a'), {href: 'data:application/json,' + encodeURIComponent(json), textContent: `keyframes.json (${keyframes.length})`});
}

// ---- controls ---------------------------------------------------------------------------------------------------
const stage = part('.stage'), photo = part('.photo'), line = part('.line'), slider = part('input'), fingers = new Map(), held = new Set();
const FLY = {w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, 1, 0], e: [0, -1, 0]};
const hint = part('.hint'), met = () => { hint.hidden = true; };
stage.onpointerdown = event => {
  met();
  stage.focus({preventScroll: true});
  event.wiping = !line.hidden && Math.abs(event.offsetX - now.wipe * canvas.clientWidth) < 14;
  fingers.set(event.pointerId, event);
  stage.setPointerCapture(event.pointerId);
};
stage.onpointermove = event => {
  const before = fingers.get(event.pointerId), other = [...fingers.values()].find(finger => finger.pointerId !== event.pointerId);
  if (!before) return;
  event.wiping = before.wiping;
  fingers.set(event.pointerId, event);
  const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY], pixel = camera.distance / camera.k[0] * cssPixel();
  const gap = finger => Math.max(Math.hypot(finger.clientX - other.clientX, finger.clientY - other.clientY), 1);
  if (event.wiping) {
    now.wipe = clamp(now.wipe + x / canvas.clientWidth, 0, 1);
    dirty = true;
  } else if (other) {
    dolly(gap(before) / gap(event));
    shift(-0.5 * x * pixel, -0.5 * y * pixel, 0);
  } else if (event.buttons > 1 || event.shiftKey) shift(-x * pixel, -y * pixel, 0);
  else if (event.altKey) turn(0.17 * x, -0.17 * y, 0);
  else turn(-0.34 * x, -0.34 * y, camera.distance);
};
stage.onpointerup = stage.onpointercancel = event => fingers.delete(event.pointerId);
stage.oncontextmenu = event => event.preventDefault();
stage.addEventListener('wheel', event => {   // a report must scroll until its viewer was clicked
  if (place === 'report' && document.activeElement !== stage) return;
  event.preventDefault();
  met();
  dolly(Math.exp(event.deltaY * 0.001));
}, {passive: false});
stage.onkeydown = event => {             // keys press buttons, fly, or change the time
  const key = event.key.toLowerCase().replace('home', 'h'), button = part(`button[data-key="${CSS.escape(key)}"]`);
  const steps = {arrowleft: -1, arrowright: 1}[key], [first, last] = scene.span ?? [0, 0];
  if (event.ctrlKey || event.metaKey || !(button?.offsetParent || FLY[key] || steps)) return;
  event.preventDefault();
  met();
  if (FLY[key]) held.add(key);
  else if (steps) seek(now.t + steps * (last - first) / 48);
  else button.click();
};
stage.onkeyup = event => held.delete(event.key.toLowerCase());
stage.onblur = () => held.clear();
new ResizeObserver(() => { dirty = true; }).observe(stage);
slider.oninput = () => {
  const [first, last] = scene.span;
  now.playing = false;
  seek(first + slider.value * (last - first));
};
root.onclick = event => {                // a pressed button that is pressed again gives way to the first of its group
  const button = event.target.closest('button'), {name, value} = button ?? {};
  if (name === 'play') now.playing = scene.span !== null && !now.playing;
  else if (name === 'keep') keep();
  else if (name === 'view') choose(+value);
  else if (name) now[name] = now[name] === value ? button.parentElement.querySelector('button').value : value;
  if (name === 'photo' && now.photo !== 'off' && now.view === null) choose(0);
  dirty = true;
};
function build() {                       // shows the controls that this scene needs
  const list = part('.cameras'), has_photos = scene.cameras.some(({photo}) => photo);
  const needed = {'.stage': true, '.tools': true, '.time': scene.span, '.modes': scene.clock, '[value=exposure]': scene.shutter,
    '.photos': has_photos, '.cameras': scene.cameras[1]};
  for (const [selector, is_needed] of Object.entries(needed)) part(selector).hidden = !is_needed;
  part('[value=training]').textContent = scene.cameras[0].size.join(' × ');
  list.replaceChildren();
  scene.cameras.forEach(({name, split, time, photo}, index) => {
    if (split && split !== scene.cameras[index - 1]?.split) make('span', list, {className: 'label', textContent: split});
    const button = make('button', list, {name: 'view', value: index, textContent: photo ? '' : name, title: isolated(name) + (time === null ? '' : ', time ' + time)});
    button.dataset.key = index + 1;
    if (photo) make('img', button, {src: photo, alt: name});
  });
}
function show() {                        // the state, as picture and in the controls
  dirty = false;
  const own = scene.cameras[now.view], shown = own?.photo ? now.photo : 'off', number = n => n.toLocaleString('en').replaceAll(',', '\u202f');
  // A picture of few pixels stays small, and shows them; one drawn as finely as the screen is has no size of its own.
  const widest = MAGNIFICATION * camera.size[0] * (shown === 'beside' ? 2 : 1);
  stage.style.maxWidth = now.pixels === 'screen' ? '' : widest + 'px';
  stage.toggleAttribute('data-small', now.pixels !== 'screen' && cssPixel() <= 0.5);
  for (const button of root.querySelectorAll('button[value]')) button.setAttribute('aria-pressed', String(now[button.name]) === button.value);
  stage.dataset.photo = shown;
  draw();
  [photo.hidden, line.hidden] = [shown === 'off', shown !== 'wipe'];
  if (!photo.hidden && photo.src !== own.photo) photo.src = own.photo;
  line.style.left = 100 * now.wipe + '%';
  photo.style.clipPath = line.hidden ? '' : `inset(0 ${100 - 100 * now.wipe}% 0 0)`;
  part('.status').textContent = [own?.split && isolated(own.name), number(scene.count) + (scene.count === 1 ? ' Gaussian' : ' Gaussians'), 'SH ' + scene.degree,
    scene.clock && number(scene.moving) + (scene.moving === 1 ? ' moves' : ' move'), `${canvas.width} × ${canvas.height} pixels`, ...scene.notes,
    !halves && 'ten bits a channel: this browser cannot draw to half floats'].filter(Boolean).join(' · ');
  const [first, last] = scene.span ?? [0, 1], [seen_from, seen_to] = scene.seen ?? [0, 1];
  part('[name=play]').textContent = now.playing ? '❚❚' : '▶';
  slider.value = (now.t - first) / (last - first);
  // Of a clock's seconds only those since the begin tell anything.
  part('output').textContent = (Math.abs(first) > 1e4 ? '+' + (now.t - first).toFixed(3) + ' s' : 't = ' + now.t.toFixed(3))
    + (now.t < seen_from || now.t > seen_to ? ' (predicted)' : '');
}

// ---- begin ------------------------------------------------------------------------------------------------------
let before = 0;
function frame(milliseconds) {
  const passed = clamp((milliseconds - before) / 1000, 0, 0.1);
  before = milliseconds;
  for (const key of held) shift(...FLY[key].map(x => x * 0.7 * camera.distance * passed));
  if (now.playing) {
    const [first, last] = scene.span, next = now.t + passed * (last - first) / PASS;
    seek(next > last ? first : next);
  }
  if (dirty) show();
  requestAnimationFrame(frame);
}
// #picture=CAMERA@TIME@MODE,...: the pictures as data URLs in the page, for tests and scripts.
function pictures(asked) {
  for (const one of asked.split(',')) {
    const [view, when, mode = 'colour'] = one.split('@');
    choose(+view);
    Object.assign(now, {t: +when, mode});
    show();
    make('pre', document.body, {className: 'picture', textContent: canvas.toDataURL('image/png')});
  }
}
try {
  if (place === 'live') return follow(load, make, make('div', root, {className: 'live'}));
  await load(given, text('viewer-block'));
  if (location.hash.startsWith('#picture=')) pictures(location.hash.slice(9));
} catch (error) {
  give_up('The scene cannot be shown here: ' + error.message);
  throw error;
}
})();
