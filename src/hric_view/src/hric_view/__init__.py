"""Window in a browser that shows arm, person and forces of a running system, or recorded runs.

The page contains all its scripts and requests nothing from other hosts. The server sends messages over a WebSocket, in
JSON without NaN:

- first the scene, `{"data": {"scene": ..., "notes": [...]}, "numbers": ...}`: robots, persons and meshes in the form
  that `report.html` has them in (`hric_report.html.scene`), and all arrays of numbers in base64;
- then frames, `{"t": time [s], "robots": [{"t": ..., "q": [...], "root": [...]}, ...], "forces": [...]}`: the newest
  joint positions [rad, m] of each robot in the order of the scene, with their time, null where none was received; the
  pose of a root link that moves, as x, y, z [m] and quaternion x, y, z, w; and the forces on the person, with name,
  point [m] and force [N].

A viewer sends nothing.
"""
