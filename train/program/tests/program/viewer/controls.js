// Works the viewer's controls as fingers, mouse and keys would, and writes what each did into the page as JSON.
// Headless Chromium skips frames when its virtual time runs, and no timers.
window.requestAnimationFrame = draw => setTimeout(() => draw(performance.now()), 16);
addEventListener('load', async () => {
  const part = selector => document.querySelector('#viewer ' + selector), stage = part('.stage'), canvas = part('canvas');
  async function frames(count) { while (count--) await new Promise(requestAnimationFrame); }
  const told = {};
  while (!part('.status').textContent) await frames(1);
  stage.setPointerCapture = () => {};    // which asks for a finger that is really there
  function pointer(type, pointerId, x, y, more) {
    const box = canvas.getBoundingClientRect();
    stage.dispatchEvent(new PointerEvent('pointer' + type, {pointerId, clientX: box.left + x, clientY: box.top + y, bubbles: true, ...more}));
  }
  function drag(from, to, more) {
    pointer('down', 1, ...from, more);
    pointer('move', 1, ...to, more);
    pointer('up', 1, ...to, more);
  }
  function key(key, type = 'keydown') { stage.dispatchEvent(new KeyboardEvent(type, {key, bubbles: true, cancelable: true})); }
  async function tell(name) {
    key('k');
    await frames(2);
    const file = JSON.parse(decodeURIComponent(part('a').href.split('application/json,')[1]));
    told[name] = {frame: file.keyframes.pop(), width: canvas.width, shown: [canvas.clientWidth, canvas.clientHeight], photo: stage.dataset.photo,
      pressed: [...document.querySelectorAll('#viewer [aria-pressed=true]')].map(button => button.value), time: part('output').textContent,
      line: parseFloat(part('.line').style.left)};
    return file;
  }
  told.hints = [part('.hint').hidden];
  await tell('begin');
  told.hints.push(part('.hint').hidden);
  const touch = {pointerType: 'touch'};
  drag([50, 60], [100, 60], touch);
  const file = await tell('orbit');
  told.picture = canvas.toDataURL('image/png');
  told.file = {...file, keyframes: [told.orbit.frame]};
  pointer('down', 1, 100, 100, touch);
  pointer('down', 2, 150, 100, touch);
  pointer('move', 2, 200, 100, touch);
  await tell('pinch');
  pointer('move', 1, 120, 100, touch);
  pointer('move', 2, 220, 100, touch);
  await tell('two fingers');
  pointer('up', 2, 220, 100, touch);
  pointer('cancel', 1, 120, 100, touch);
  pointer('move', 1, 300, 300, touch);
  await tell('released');
  for (const [name, more] of [['shift', {shiftKey: true}], ['right button', {buttons: 2}], ['alt', {altKey: true}]]) {
    drag([50, 60], [70, 50], more);
    await tell(name);
  }
  stage.dispatchEvent(new WheelEvent('wheel', {deltaY: 100, cancelable: true}));
  await tell('wheel');
  key('w');
  await frames(3);
  key('w', 'keyup');
  await tell('fly');
  await frames(2);
  await tell('flown');
  key('Home');
  await tell('home');
  for (const name of ['2', 'h', 'p', 'o', 'o', 'p']) {
    key(name);
    await tell(name in told ? name + ' again' : name);
  }
  const middle = canvas.clientWidth / 2;
  drag([middle, 20], [middle / 2, 20]);
  await tell('wiped');
  for (const name of ['v', 'b', 'b', 'f', 'ArrowRight']) {
    key(name);
    await tell(name in told ? name + ' again' : name);
  }
  const slider = part('input');
  slider.value = 0.25;
  slider.dispatchEvent(new Event('input'));
  await tell('slider');
  key(' ');
  await frames(3);
  key(' ');
  await tell('played');
  await frames(2);
  await tell('paused');
  const pre = document.body.appendChild(document.createElement('pre'));
  pre.className = 'told';
  pre.textContent = JSON.stringify(told);
});
