// Files dropped anywhere, or chosen, go to the workbench one by one as they are; what it says of them stands in one line.
(() => {
  const line = document.createElement('div'); // beside the page, which is drawn anew at any time
  line.id = 'upload-words';
  line.hidden = true;
  line.innerHTML = '<span></span> <progress max="1" aria-label="upload" hidden></progress> '
    + '<a href="/" hidden>Go on with the others</a>';
  document.body.append(line);

  const shown = (words, part = null, alarm = false) => {
    line.querySelector('span').textContent = words;
    line.classList.toggle('bad', alarm);
    line.setAttribute('role', alarm ? 'alert' : 'status');
    const bar = line.querySelector('progress');
    bar.hidden = part === null;
    bar.value = part ?? 0;
    line.hidden = !words;
  };

  const put = (session, file, told) => new Promise((done, failed) => {
    const request = new XMLHttpRequest();
    request.open('PUT', `/api/v1/sessions/${session}/files/${encodeURIComponent(file.name)}`);
    request.upload.onprogress = (event) => told(event.loaded);
    request.onload = () => (request.status < 300 ? done() : failed(said(request.responseText, request.statusText)));
    request.onerror = () => failed(`${file.name}: the workbench does not answer, or the file cannot be read`);
    request.send(file);
  });

  const said = (text, otherwise) => {
    try { return JSON.parse(text).error || otherwise; } catch { return otherwise; }
  };

  const begun = async (title) => {
    const made = await fetch('/api/v1/sessions', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json' },
      body: JSON.stringify({ title }),
    }).catch(() => { throw 'the workbench does not answer'; });
    if (!made.ok) throw said(await made.text(), made.statusText);
    return (await made.json()).session;
  };

  const take = async (files) => {
    if (!files.length) return;
    const whole = files.reduce((sum, file) => sum + file.size, 0) || 1;
    const refused = [];
    let session = (location.pathname.match(/^\/sessions\/(\d+)/) || [])[1];
    let before = 0;
    try {
      session = session || await begun(files[0].name);
    } catch (error) {
      shown(String(error), null, true);
      return;
    }
    for (const [number, file] of files.entries()) {
      const told = (loaded) => {
        const part = Math.min((before + loaded) / whole, 1);
        shown(`${number + 1} of ${files.length}, ${file.name}: ${Math.round(100 * part)} % of all`, part);
      };
      told(0);
      await put(session, file, told).catch((error) => refused.push(error));
      before += file.size;
    }
    const target = `/sessions/${session}/recording?new=1`;
    if (!refused.length) { location.assign(target); return; }
    shown(refused.join('; '), null, true);
    if (refused.length === files.length) return;
    const link = line.querySelector('a');
    link.href = target;
    link.hidden = false;
  };

  window.inercalTake = (input) => take([...input.files]);
  document.addEventListener('dragover', (event) => { event.preventDefault(); document.body.classList.add('dropping'); });
  document.addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('dropping');
    take([...event.dataTransfer.files]);
  });

  window.inercalCopy = async (button) => {
    const beside = button.closest('.copies').querySelector('textarea, [data-command]');
    const text = beside.value ?? beside.textContent;
    let copied = true;
    try {
      await navigator.clipboard.writeText(text);
    } catch { // a page of another machine without TLS has no clipboard
      const area = document.createElement('textarea');
      area.value = text;
      document.body.append(area);
      area.select();
      copied = document.execCommand('copy');
      area.remove();
      button.focus();
    }
    shown(copied ? 'Copied.' : 'This browser does not let a page copy: select the text.');
    setTimeout(() => shown(''), 2000);
  };
})();
