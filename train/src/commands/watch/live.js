// Follows a training: asks gsburn watch for its state, and for the scene where there is a new one.
function follow(load, make, live) {
  let version = null;
  async function fetched(name) {
    try { return await (await fetch(name, {cache: 'no-store'})).json(); } catch { throw new Error('gsburn watch does not answer.'); }
  }
  async function poll() {
    try {
      const state = await fetched('state.json');
      if (state.version !== version) {
        const next = await fetched('scene.json');
        if (next.scene) {
          await load(next.scene, next.block);
          version = next.version;
        }
      }
      live.replaceChildren();
      make('p', live, {textContent: state.text});
      for (const {name, points} of state.curves) if (points.length > 1) chart(make, make('figure', live), name, points);
    } catch (error) {
      live.replaceChildren();
      make('p', live, {textContent: error.message});
    }
    setTimeout(poll, 3000);
  }
  return poll();
}
function chart(make, figure, name, points) {
  const [xs, ys] = [points.map(p => p[0]), points.map(p => p[1])], span = v => [Math.min(...v), Math.max(...v)];
  const [[x0, x1], [y0, y1]] = [span(xs), span(ys)], svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 300 60'); svg.setAttribute('preserveAspectRatio', 'none');
  const line = document.createElementNS(svg.namespaceURI, 'polyline');
  line.setAttribute('points', points.map(([x, y]) => `${300 * (x - x0) / (x1 - x0 || 1)},${57 - 54 * (y - y0) / (y1 - y0 || 1)}`).join(' '));
  svg.append(line); figure.append(svg);
  make('figcaption', figure, {textContent: `${name}: ${+ys[ys.length - 1].toPrecision(4)}`});
}
