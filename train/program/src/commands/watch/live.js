// Follows a training: asks gsburn watch for its state, and for the scene where there is a new one.
function follow(load, make, live) {
  const root = live.parentElement, told = make('p', live), plots = make('div', live, {className: 'plots'});
  let version = null, charts = '';
  async function fetched(name) {
    try { return await (await fetch(name, {cache: 'no-store'})).json(); } catch { throw new Error('gsburn watch does not answer.'); }
  }
  function draw(svgs) {
    if (charts === (charts = svgs.join())) return;
    plots.replaceChildren();
    for (const svg of svgs) make('img', make('figure', plots), {src: 'data:image/svg+xml,' + encodeURIComponent(svg)});
  }
  async function poll() {
    try {
      const state = await fetched('state.json');
      if (state.version && state.version !== version) {
        const next = await fetched('scene.json');
        await load(next.scene, next.block);
        version = next.version;
      }
      root.toggleAttribute('data-empty', !state.version);
      told.textContent = state.text;
      draw(state.charts);
    } catch (error) {
      told.textContent = error.message;
    }
    setTimeout(poll, 3000);
  }
  return poll();
}
