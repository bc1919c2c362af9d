"""The rendered viewport: `beamfarm live` renders what the export writes, and sends pictures over a WebSocket.

`websocket` is the protocol, `live` the process at its other end, `sight` the viewport's camera, and `session` ties them
to one viewport. Only `draw` needs a GPU, and only `session` uses the export.
"""
