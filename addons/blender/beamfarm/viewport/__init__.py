"""The rendered viewport: `beamfarm live` renders what the export writes, and sends pictures over a WebSocket.

`websocket` is the wire, `live` the process at its other end, `sight` the viewport's camera, `session` what ties them to
one viewport. Only `draw` needs a GPU, and only `session` knows of the export.
"""
