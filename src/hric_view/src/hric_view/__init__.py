"""Window in a browser: arm, person and forces of a running system.

The page has everything in it and requests nothing from other hosts. After the handshake the server sends messages of
JSON without NaN by a WebSocket:

- first the scene, `{"data": {"scene": ..., "notes": [...]}, "numbers": ...}`: robots, persons and meshes in the form
  that `report.html` has them in (`hric_report.html.scene`), and all arrays of numbers in base64;
- then frames, `{"t": time [s], "robots": [{"t": ..., "q": [...], "root": [...]}, ...], "forces": [...]}`: the newest
  joint positions [rad, m] of each robot in the order of the scene, with their time, null where none was received; the
  pose of a root link that moves, as x, y, z [m] and quaternion x, y, z, w; and the forces on the person, with name,
  point [m] and force [N].

A viewer sends nothing.
"""
