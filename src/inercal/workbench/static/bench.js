// Files dropped anywhere, or chosen, go to the workbench one by one as they are.
(() => {
  const shown = (words) => {
    const bar = document.getElementById('upload-words');
    if (bar) bar.textContent = words;
  };

  const put = (session, file) => new Promise((done, failed) => {
    const request = new XMLHttpRequest();
    request.open('PUT', `/api/v1/sessions/${session}/files/${encodeURIComponent(file.name)}`);
    request.upload.onprogress = (event) => {
      if (event.lengthComputable) shown(`${file.name}: ${Math.round(100 * event.loaded / event.total)} %`);
    };
    request.onload = () => (request.status < 300 ? done() : failed(request.responseText));
    request.onerror = () => failed('the workbench does not answer');
    request.send(file);
  });

  const words = (error) => {
    try { return JSON.parse(error).error || String(error); } catch { return String(error.message || error); }
  };

  const take = async (files) => {
    if (!files.length) return;
    try {
      let session = (location.pathname.match(/^\/sessions\/(\d+)/) || [])[1];
      if (!session) {
        const made = await fetch('/api/v1/sessions', {
          method: 'POST',
          headers: { 'Content-Type': 'application/json' },
          body: JSON.stringify({ title: files[0].name }),
        });
        session = (await made.json()).session;
      }
      for (const file of files) await put(session, file);
      location.assign(`/sessions/${session}/recording?new=1`);
    } catch (error) {
      shown(words(error));
      const alert = document.getElementById('upload-words');
      if (alert) alert.setAttribute('role', 'alert');
    }
  };

  window.inercalTake = (input) => take([...input.files]);
  document.addEventListener('dragover', (event) => { event.preventDefault(); document.body.classList.add('dropping'); });
  document.addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('dropping');
    take([...event.dataTransfer.files]);
  });
})();
