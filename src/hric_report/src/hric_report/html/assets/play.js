"use strict";
// Playing of a replay, from report.time on, at the speed that is chosen beside the bar of time.
{
  const find = (id) => document.getElementById(id);
  let playing = false, before = 0;

  const play = (now) => {
    if (!playing) return;
    const next = report.time + ((now - before) / 1000) * Number(find("speed").value);
    before = now;
    report.setTime(next);
    if (next >= report.end) report.setPlaying(false); else requestAnimationFrame(play);
  };

  report.isPlaying = () => playing;

  report.setPlaying = (desired) => {
    playing = desired;
    find("play").textContent = desired ? "pause" : "play";
    if (!desired) return;
    if (report.time >= report.end) report.setTime(report.begin);
    before = performance.now();
    requestAnimationFrame(play);
  };
}
