// A test from moment to moment: what its joints carry is turned, as a slider or the clock says.
(() => {
  const wait = (time) => new Promise((done) => setTimeout(done, time));
  let told = null;
  let playing = 0;

  const turned = (pose, points) => {
    const at = [[], [], []];
    for (const point of points) {
      for (let i = 0; i < 3; i++) {
        const gap = point.some((each) => each === null);
        at[i].push(gap ? null : pose[3 * i] * point[0] + pose[3 * i + 1] * point[1] + pose[3 * i + 2] * point[2]);
      }
    }
    return at;
  };

  const show = async (moment) => {
    const { Plotly } = await import('nicegui-plotly');
    const words = document.getElementById('moment-words');
    if (words) words.textContent = told.words[moment];
    for (const scene of told.scenes) {
      const place = document.getElementById(scene.place);
      if (!place || !place.data) continue;
      const x = [], y = [], z = [], traces = [];
      for (const each of scene.traces) {
        const at = each.body < 0 ? told.up[moment].map((one) => [one]) : turned(told.poses[moment][each.body], each.points);
        x.push(at[0]); y.push(at[1]); z.push(at[2]);
        traces.push(each.trace);
      }
      await Plotly.restyle(place, { x, y, z }, traces);
    }
  };

  window.inercalMotion = async (given) => {
    told = given;
    const slider = document.getElementById('moment');
    if (!slider) return;
    slider.max = told.words.length - 1;
    if (+slider.value > +slider.max) slider.value = 0;
    for (let k = 0; k < 100 && !told.scenes.every((each) => document.getElementById(each.place)?.data); k++) await wait(50);
    await show(+slider.value);
  };

  window.inercalMoment = () => { if (told) show(+document.getElementById('moment').value); };

  window.inercalPlay = async () => {
    const slider = document.getElementById('moment');
    const own = ++playing;
    if (slider.dataset.plays) { delete slider.dataset.plays; return; }
    slider.dataset.plays = '1';
    if (+slider.value >= +slider.max) slider.value = 0;
    while (told && slider.isConnected && own === playing && slider.dataset.plays && +slider.value < +slider.max) {
      slider.value = +slider.value + 1;
      await show(+slider.value);
      await wait(60);
    }
    if (own === playing) delete slider.dataset.plays;
  };
})();
